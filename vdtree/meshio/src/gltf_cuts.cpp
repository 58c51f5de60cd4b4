// Cuts as glTF: scenes and models, with one level of detail or several.

#include <unseen/meshio/scene_file.h>

#include <glm/common.hpp>

#include "file_output.h"
#include "gltf_data.h"
#include "gltf_writer.h"
#include "restore.h"
#include "write_cut.h"

namespace unseen::meshio {

namespace fs = std::filesystem;
using nlohmann::json;

namespace {

using Part = SourceDocument::Part;

Result<void> check(const fs::path& file, const LevelCuts& levels) {
    const auto refuse = [&](const std::string& why) {
        return Error{ErrorCode::invalid_argument, "Cannot write '" + file.string() + "': " + why};
    };
    if (!is_gltf_file(file))
        return refuse("levels of detail go into glTF files alone; let its name end in .glb or .gltf.");
    if (levels.cuts.empty()) return refuse("a node has no level.");
    if (levels.coverages.size() != levels.cuts.size())
        return refuse(
            text_of("a node has ", levels.cuts.size(), " levels and ", levels.coverages.size(), " coverages."));
    double before = 1;
    for (const double coverage : levels.coverages) {
        if (!(coverage >= 0 && coverage <= before)) return refuse("coverages must descend from 1 to 0.");
        before = coverage;
    }
    for (std::size_t i = 1; i < levels.cuts.size(); ++i)
        if (levels.cuts[i]->triangle_count() == 0) return refuse(text_of("level ", i, " of a node has no triangles."));
    return {};
}

// Whether nothing is folded, not even what leaves no triangle out.
bool is_whole(const Cut& cut) {
    const VertexTree& tree = cut.tree();
    for (Index leaf = 0; leaf < tree.leaf_count(); ++leaf)
        if (!tree.is_place(cut.proxy_of_leaf(leaf))) return false;
    return true;
}

std::string level_name(const json& node, std::size_t level) {
    return text_of(node.value("name", std::string("node")), "_lod", level);
}

// What another level replaces must be the mesh alone, not children, cameras and lights.
bool is_only_a_place(const json& node) {
    for (const auto& [key, value] : node.items()) {
        constexpr std::string_view plain[] = {"name", "matrix", "translation", "rotation", "scale"};
        const bool is_extras = key == "extras" && value.is_object();
        if (!is_extras && std::ranges::find(plain, key) == std::end(plain)) return false;
    }
    return true;
}

class CutWriter {
public:
    CutWriter(const fs::path& name, const GltfOptions& options, LevelsWritten& result)
        : name_(name), result_(result), file_(options) {}

    Result<void> write_scene(const SceneSource& source, std::span<const LevelCuts> all) {
        begin(source.json, std::ranges::any_of(all, [](const LevelCuts& levels) { return levels.cuts.size() > 1; }));
        std::size_t empty = 0;
        for (const LevelCuts& levels : all) {
            if (const auto valid = check(name_, levels); !valid) return valid;
            if (levels.cuts[0]->triangle_count() == 0) ++empty;
            else if (const auto added = add_node(levels); !added) return added;
        }
        if (empty > 0)
            result_.notes.push_back(
                text_of(empty, empty == 1 ? " node has" : " nodes have", " no triangle left, and no mesh any more."));
        if (written_.empty())
            return failed_to_write(name_, "no triangle is left; move nearer or allow more triangles.");
        SourceDocument images;
        images.files = source.files;
        if (const auto written = write_beside(name_, images, result_.notes); !written) return written;
        return finish(images);
    }

    Result<void> write_model(const LevelCuts& levels) {
        if (const auto valid = check(name_, levels); !valid) return valid;
        if (levels.cuts[0]->triangle_count() == 0)
            return failed_to_write(name_, "the cut has no triangles, and no format holds materials of nothing.");
        SourceDocument document;
        std::vector<std::string> uvs;
        if (const auto bytes = levels.cuts[0]->tree().document(); !bytes.empty()) {
            auto unpacked = document_of(levels.cuts[0]->tree());
            if (!unpacked) return unpacked.error();
            document = std::move(*unpacked);
        }
        const bool is_plain = document.parts.empty();
        if (is_plain) { // one node
            document = {.json = R"({"scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{}]})"};
        } else {
            uvs = drawn_uvs(document);
            document = as_gltf(std::move(document), result_.notes);
        }
        if (const auto written = write_beside(name_, document, result_.notes); !written) return written;
        begin(document.json, levels.cuts.size() > 1);
        for (std::size_t level = 0; level < levels.cuts.size(); ++level) {
            const std::uint64_t before = file_.bytes();
            const Cut& cut = *levels.cuts[level];
            const ExtractedMesh extracted = extract_with_sources(cut);
            if (is_plain) {
                add_plain(extracted.mesh, level);
            } else {
                auto restored = restore(cut, extracted, document, uvs);
                if (!restored) return restored.error();
                add_parts(parts_.emplace_back(std::move(*restored)), level, document);
            }
            result_.bytes.push_back(file_.bytes() - before);
        }
        if (levels.cuts.size() > 1) {
            // One root above all, for another level replaces everything.
            json& scene = shown_scene();
            const std::size_t first = add_node_json({{"name", name_.stem().string()}, {"children", scene["nodes"]}});
            scene["nodes"] = json::array({first});
            std::vector<std::size_t> ids;
            for (std::size_t i = 0; i < further_.size(); ++i)
                ids.push_back(add_node_json({{"name", level_name(node_at(first), i + 1)}, {"children", further_[i]}}));
            tell_levels(first, ids, levels.coverages);
        }
        return finish(document);
    }

private:
    // A mesh of the file, with the grid that it lies on.
    struct WrittenMesh {
        std::size_t number = 0;
        GltfGrid grid = {};
    };

    // ---- the document

    void begin(const std::string& source, bool has_levels) {
        out_ = gltf::parse_json(source);
        if (!out_.contains("nodes")) out_["nodes"] = json::array();
        for (json& node : out_["nodes"]) node.erase("mesh");
        if (has_levels && !has_scenes()) make_scene();
        meshes_ = out_.value("meshes", json::array());
    }

    Result<void> finish(const SourceDocument& document) {
        out_["meshes"] = std::move(written_);
        // Images that lay in the source's file.
        for (std::size_t i = 0; out_.contains("images") && i < out_["images"].size() && i < document.files.size();
             ++i) {
            const SourceDocument::File& image = document.files[i];
            if (!image.uri.empty() || !image.bytes) continue;
            json& out = out_["images"][i];
            out["bufferView"] = file_.add_bytes(*image.bytes);
            if (!out.contains("mimeType"))
                out["mimeType"] = image.bytes->starts_with("\x89PNG")        ? "image/png"
                                  : image.bytes->starts_with("\xFF\xD8\xFF") ? "image/jpeg"
                                                                             : "application/octet-stream";
        }
        return file_.write(name_, std::move(out_));
    }

    bool has_scenes() const { return out_.contains("scenes") && !out_["scenes"].empty(); }
    json& shown_scene() { return out_["scenes"].at(out_.value("scene", std::size_t{0})); }
    json& node_at(std::size_t node) { return out_["nodes"].at(node); }
    std::size_t add_node_json(json node) {
        out_["nodes"].push_back(std::move(node));
        return out_["nodes"].size() - 1;
    }

    // Without scenes all nodes are shown, which those of further levels must not be.
    void make_scene() {
        std::vector<bool> is_child(out_["nodes"].size());
        for (const json& node : out_["nodes"])
            for (const json& child : node.value("children", json::array()))
                is_child.at(child.get<std::size_t>()) = true;
        json scene = json::object();
        for (std::size_t i = 0; i < is_child.size(); ++i)
            if (!is_child[i]) scene["nodes"].push_back(i);
        out_["scenes"] = json::array({std::move(scene)});
        out_["scene"] = 0;
    }

    void show(std::size_t node, const WrittenMesh& mesh) {
        if (!mesh.grid.is_used()) {
            node_at(node)["mesh"] = mesh.number;
            return;
        }
        json holder = GltfFile::transform_of(mesh.grid);
        holder["mesh"] = mesh.number;
        const std::size_t child = add_node_json(std::move(holder));
        node_at(node)["children"].push_back(child);
    }

    // Names the further levels of a node, which are its own.
    void tell_levels(std::size_t node, const std::vector<std::size_t>& ids, const std::vector<double>& coverages) {
        node_at(node)["extensions"][gltf::lod_extension] = {{"ids", ids}};
        node_at(node)["extras"]["MSFT_screencoverage"] = coverages;
        json& used = out_["extensionsUsed"];
        if (std::find(used.begin(), used.end(), gltf::lod_extension) == used.end()) used.push_back(gltf::lod_extension);
    }

    // ---- meshes

    // Puts a part in the order that suits the file.
    void sort(RestoredPart& part, const SourceDocument& document) const {
        GltfOrder order = optimized(part.triangles, part.positions.size());
        const auto sorted = [&](auto& values, std::size_t components) {
            auto old = std::move(values);
            values.clear();
            for (const Index v : order.vertices)
                values.insert(values.end(), old.begin() + static_cast<std::ptrdiff_t>(v * components),
                              old.begin() + static_cast<std::ptrdiff_t>((v + 1) * components));
        };
        part.triangles = std::move(order.triangles);
        sorted(part.positions, 1), sorted(part.vertices, 1);
        for (std::size_t c = 0; c < part.channels.size(); ++c)
            if (!part.channels[c].empty()) sorted(part.channels[c], document.channels[c].components);
    }

    json primitive_of(RestoredPart& part, const SourceDocument& document, const GltfGrid& grid) {
        if (file_.reorders()) sort(part, document);
        json attributes = {{"POSITION", file_.add_positions(part.positions, grid)}};
        for (std::size_t c = 0; c < part.channels.size(); ++c)
            if (!part.channels[c].empty())
                attributes[document.channels[c].name] =
                    file_.add_attribute(document.channels[c].name, part.channels[c], document.channels[c].components);
        return file_.primitive(attributes, file_.add_indices(part.triangles), 0, part.triangles.size());
    }

    GltfGrid grid_of(const std::vector<RestoredPart*>& parts) const {
        glm::vec3 low = parts.at(0)->positions.at(0), high = low;
        for (const RestoredPart* part : parts)
            for (const glm::vec3& p : part->positions) low = glm::min(low, p), high = glm::max(high, p);
        return file_.grid_for(low, high);
    }

    // A mesh of the source with the triangles of these parts, which are brought into its order.
    WrittenMesh add_mesh(std::int32_t number, std::vector<RestoredPart*>& parts, std::size_t level,
                         const SourceDocument& document) {
        std::ranges::sort(parts, {}, [&](const RestoredPart* part) { return document.parts[part->part].primitive; });
        json mesh = meshes_.at(static_cast<std::size_t>(number));
        const json source = mesh.at("primitives");
        const WrittenMesh written{written_.size(), grid_of(parts)};
        mesh["primitives"] = json::array();
        for (RestoredPart* part : parts) {
            json primitive = source.at(static_cast<std::size_t>(document.parts[part->part].primitive));
            primitive.update(primitive_of(*part, document, written.grid));
            mesh["primitives"].push_back(std::move(primitive));
        }
        if (level > 0 && mesh.contains("name")) mesh["name"] = level_name(mesh, level);
        written_.push_back(std::move(mesh));
        return written;
    }

    // ---- scenes

    Result<void> add_node(const LevelCuts& levels) {
        auto node = static_cast<std::size_t>(levels.node);
        if (levels.node < 0) {
            node = add_node_json(json::object());
            if (has_scenes()) shown_scene()["nodes"].push_back(node); // else all are shown
        }
        const auto first = mesh_of(levels, 0);
        if (!first) return first.error();
        if (levels.cuts.size() == 1) {
            show(node, *first);
            return {};
        }
        if (!is_only_a_place(node_at(node))) {
            json holder = json::object();
            if (node_at(node).contains("name")) holder["name"] = node_at(node)["name"];
            const std::size_t child = add_node_json(std::move(holder));
            node_at(node)["children"].push_back(child);
            node = child;
        }
        json place = json::object(); // that levels are shown at
        for (const char* key : {"matrix", "translation", "rotation", "scale"})
            if (node_at(node).contains(key)) place[key] = node_at(node)[key];
        std::vector<std::size_t> ids;
        for (std::size_t level = 1; level < levels.cuts.size(); ++level) {
            const auto mesh = mesh_of(levels, level);
            if (!mesh) return mesh.error();
            json further = place;
            further["name"] = level_name(node_at(node), level);
            ids.push_back(add_node_json(std::move(further)));
            show(ids.back(), *mesh);
        }
        show(node, *first);
        tell_levels(node, ids, levels.coverages);
        return {};
    }

    // What a mesh of the output is of.
    struct Look {
        std::int32_t mesh;
        const void* tree;
        std::vector<WedgeId> vertices;
        auto operator<=>(const Look&) const = default;
    };

    Result<WrittenMesh> mesh_of(const LevelCuts& levels, std::size_t level) {
        const Cut& cut = *levels.cuts[level];
        const auto [of_cut, is_new_cut] = mesh_of_cut_.try_emplace({&cut, levels.mesh});
        if (!is_new_cut) return of_cut->second;
        ExtractedMesh extracted = extract_with_sources(cut);
        // The same vertices of one tree are one mesh. Trees that differ by a stretch alone are the same mesh if nothing
        // is folded.
        const bool is_all = is_whole(cut);
        Look look{levels.mesh, is_all ? nullptr : cut.tree().positions().data(), {}};
        if (!is_all) look.vertices = extracted.wedges;
        const auto [known, is_new] = written_as_.try_emplace(std::move(look));
        if (!is_new) return of_cut->second = known->second;
        const std::uint64_t before = file_.bytes();
        const auto document = document_of(cut.tree());
        if (!document) return document.error();
        if (document->format != SourceDocument::Format::gltf) fail("it is of another format.");
        auto restored = restore(cut, extracted, *document, drawn_uvs(*document));
        if (!restored) return restored.error();
        std::vector<RestoredPart*> parts;
        for (RestoredPart& part : parts_.emplace_back(std::move(*restored))) parts.push_back(&part);
        known->second = add_mesh(levels.mesh, parts, level, *document);
        result_.bytes.resize(std::max(result_.bytes.size(), level + 1));
        result_.bytes[level] += file_.bytes() - before;
        return of_cut->second = known->second;
    }

    // ---- models

    // A mesh for each node that has some of the parts.
    void add_parts(std::vector<RestoredPart>& restored, std::size_t level, const SourceDocument& document) {
        std::map<std::pair<std::int32_t, std::int32_t>, std::vector<RestoredPart*>> meshes; // by mesh and node
        for (RestoredPart& part : restored)
            meshes[{document.parts[part.part].mesh, document.parts[part.part].node}].push_back(&part);
        std::map<std::int32_t, std::size_t> copies;
        for (auto& [key, parts] : meshes) {
            ++copies[key.first];
            const WrittenMesh mesh = add_mesh(key.first, parts, level, document);
            const Part& part = document.parts[parts[0]->part];
            std::size_t node = 0;
            if (level == 0) {
                node = node_for(part, *parts[0]);
            } else {
                json further = json::object();
                if (part.node >= 0) further["name"] = level_name(node_at(static_cast<std::size_t>(part.node)), level);
                if (!parts[0]->is_in_world && part.to_world != glm::dmat4(1))
                    for (int i = 0; i < 16; ++i) further["matrix"].push_back(part.to_world[i / 4][i % 4]);
                node = add_node_json(std::move(further));
                children_of(level).push_back(node);
            }
            show(node, mesh);
        }
        const auto instances = std::ranges::count_if(copies, [](const auto& of) { return of.second > 1; });
        if (instances > 0 && level == 0)
            result_.notes.push_back(counted_were(static_cast<std::uint64_t>(instances), "mesh") +
                                    " under several nodes; each node has a mesh of its own now.");
    }

    // The node of a part, or a new one beside all others, where there is none or its frame cannot be turned back.
    std::size_t node_for(const Part& part, const RestoredPart& restored) {
        const bool is_known = part.node >= 0 && static_cast<std::size_t>(part.node) < out_["nodes"].size();
        if (is_known && !restored.is_in_world) return static_cast<std::size_t>(part.node);
        json node = json::object();
        const json& named =
            is_known ? node_at(static_cast<std::size_t>(part.node)) : meshes_.at(static_cast<std::size_t>(part.mesh));
        if (named.contains("name")) node["name"] = named["name"];
        if (is_known)
            result_.notes.push_back("a node whose transform has no inverse got a copy beside it, which has the mesh.");
        const std::size_t number = add_node_json(std::move(node));
        if (is_known && !out_.contains("scenes")) return number; // all are shown
        json& scenes = out_["scenes"];
        if (!scenes.is_array() || scenes.empty()) scenes = json::array({json::object()});
        shown_scene()["nodes"].push_back(number);
        return number;
    }

    // For PLY and the like: what the mesh itself has.
    void add_plain(const Mesh& mesh, std::size_t level) {
        RestoredPart& part = parts_.emplace_back(1).front();
        SourceDocument document;
        part.triangles = mesh.triangles;
        if (level == 0) {
            // Floats, relative to a middle where they would lose digits.
            glm::dvec3 low = mesh.positions[0], high = low;
            bool are_exact = true;
            for (const glm::dvec3& p : mesh.positions) {
                low = glm::min(low, p), high = glm::max(high, p);
                are_exact = are_exact && glm::dvec3(glm::vec3(p)) == p;
            }
            if (!are_exact) origin_ = low / 2.0 + high / 2.0;
        }
        for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
            part.vertices.push_back(static_cast<Index>(v));
            part.positions.emplace_back(mesh.positions[v] - origin_);
        }
        const auto add_channel = [&](const char* name, std::uint32_t components, const auto& values) {
            if (values.empty()) return;
            document.channels.push_back({name, components, {}});
            const auto floats = floats_of(values);
            part.channels.emplace_back(floats.begin(), floats.end());
        };
        std::vector<glm::vec3> normals;
        for (const glm::vec3& n : mesh.normals) {
            const float length = glm::length(n);
            normals.push_back(length > 0 ? n / length : glm::vec3(0, 0, 1)); // glTF knows none without a length
        }
        add_channel("NORMAL", 3, normals);
        add_channel("COLOR_0", 4, mesh.colours);
        add_channel("TEXCOORD_0", 2, mesh.uvs);
        const std::size_t node = level > 0 ? add_node_json(json::object()) : 0;
        if (level > 0) children_of(level).push_back(node);
        if (origin_ != glm::dvec3(0)) node_at(node)["translation"] = {origin_.x, origin_.y, origin_.z};
        const WrittenMesh written{written_.size(), grid_of({&part})};
        show(node, written);
        written_.push_back({{"primitives", json::array({primitive_of(part, document, written.grid)})}});
    }

    std::vector<std::size_t>& children_of(std::size_t level) {
        further_.resize(std::max(further_.size(), level));
        return further_[level - 1];
    }

    const fs::path& name_;
    LevelsWritten& result_;
    GltfFile file_;
    json out_, meshes_, written_ = json::array(); // the document; meshes as they were, and as they are written
    std::deque<std::vector<RestoredPart>> parts_; // which the file refers to
    std::map<std::pair<const Cut*, std::int32_t>, WrittenMesh> mesh_of_cut_;
    std::map<Look, WrittenMesh> written_as_;
    std::vector<std::vector<std::size_t>> further_; // nodes of levels 1 and on, of a model
    glm::dvec3 origin_ = glm::dvec3(0);             // of plain models
};

} // namespace

Result<LevelsWritten> write_scene(const fs::path& file, const SceneSource& source, std::span<const LevelCuts> nodes,
                                  const GltfOptions& options) {
    LevelsWritten result;
    const auto written = guarded_writing([&] { return CutWriter(file, options, result).write_scene(source, nodes); });
    if (!written) return written.error();
    return result;
}

Result<LevelsWritten> write_model_levels(const fs::path& file, const LevelCuts& levels, const GltfOptions& options) {
    LevelsWritten result;
    const auto written = guarded_writing([&] { return CutWriter(file, options, result).write_model(levels); });
    if (!written) return written.error();
    return result;
}

} // namespace unseen::meshio
