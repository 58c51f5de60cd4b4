// Levels of detail in one glTF file.
#include <unseen/meshio/scene_file.h>

#include <algorithm>
#include <deque>
#include <map>
#include <optional>
#include <string_view>
#include <tuple>
#include <utility>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <nlohmann/json.hpp>

#include "file_output.h"
#include "gltf_data.h"
#include "gltf_document.h"
#include "gltf_parts.h"
#include "gltf_writer.h"
#include "material_formats.h"
#include "mesh_readers.h"
#include "restore.h"

namespace unseen::meshio {

namespace fs = std::filesystem;
using nlohmann::json;

namespace {

constexpr const char* screen_coverage = "MSFT_screencoverage";

Result<void> check(const fs::path& file, const LevelCuts& levels) {
    const auto refuse = [&](const std::string& why) {
        return Error{ErrorCode::invalid_argument, "Cannot write '" + file.string() + "': " + why};
    };
    const std::string ending = lower_ending(file);
    if (ending != ".glb" && ending != ".gltf")
        return refuse("levels of detail go into glTF files alone; let its name end in .glb or .gltf.");
    if (levels.cuts.empty()) return refuse("a node has no level.");
    if (levels.coverages.size() != levels.cuts.size())
        return refuse("a node has " + std::to_string(levels.cuts.size()) + " levels and " +
                      std::to_string(levels.coverages.size()) + " coverages.");
    double before = 1;
    for (const double coverage : levels.coverages) {
        if (!(coverage >= 0 && coverage <= before)) return refuse("coverages must descend from 1 to 0.");
        before = coverage;
    }
    for (std::size_t i = 1; i < levels.cuts.size(); ++i)
        if (levels.cuts[i]->triangle_count() == 0)
            return refuse("level " + std::to_string(i) + " of a node has no triangles.");
    return {};
}

// Meshes of the file, each with the grid that it lies on.
struct WrittenMesh {
    std::size_t number = 0;
    GltfGrid grid = {};
};

void show(json& nodes, std::size_t node, const WrittenMesh& mesh) {
    if (!mesh.grid.is_used()) {
        nodes.at(node)["mesh"] = mesh.number;
        return;
    }
    json holder = GltfFile::transform_of(mesh.grid);
    holder["mesh"] = mesh.number;
    nodes.at(node)["children"].push_back(nodes.size());
    nodes.push_back(std::move(holder));
}

// Names the further levels of a node, which are its own.
void tell_levels(json& out, std::size_t node, const std::vector<std::size_t>& ids,
                 const std::vector<double>& coverages) {
    json& first = out["nodes"].at(node);
    first["extensions"][gltf::lod_extension] = {{"ids", ids}};
    first["extras"][screen_coverage] = coverages;
    json& used = out["extensionsUsed"];
    if (std::find(used.begin(), used.end(), gltf::lod_extension) == used.end()) used.push_back(gltf::lod_extension);
}

// Without scenes all nodes are shown, which those of further levels must not be.
void make_scene(json& out) {
    if (out.contains("scenes") && !out["scenes"].empty()) return;
    std::vector<bool> is_child(out["nodes"].size());
    for (const json& node : out["nodes"])
        for (const json& child : node.value("children", json::array())) is_child.at(child.get<std::size_t>()) = true;
    json roots = json::array();
    for (std::size_t i = 0; i < is_child.size(); ++i)
        if (!is_child[i]) roots.push_back(i);
    json scene = json::object();
    if (!roots.empty()) scene["nodes"] = std::move(roots);
    out["scenes"] = json::array({std::move(scene)});
    out["scene"] = 0;
}

json& shown_scene(json& out) { return out["scenes"].at(out.value("scene", std::size_t{0})); }

GltfGrid grid_of(const GltfFile& file, const std::vector<RestoredPart*>& parts) {
    glm::vec3 low = parts.at(0)->positions.at(0), high = low;
    for (const RestoredPart* part : parts)
        for (const glm::vec3& p : part->positions) low = glm::min(low, p), high = glm::max(high, p);
    return file.grid_for(low, high);
}

std::string level_name(const json& node, std::size_t level) {
    return node.value("name", std::string("node")) + "_lod" + std::to_string(level);
}

// ---- scenes

class SceneLevelWriter {
public:
    SceneLevelWriter(const SceneSource& source, const GltfOptions& options, LevelsWritten& result)
        : source_(source), result_(result), file_(options) {}

    Result<void> write(const fs::path& name, std::span<const LevelCuts> all) {
        out_ = gltf::parse_json(source_.json);
        if (!out_.contains("nodes")) out_["nodes"] = json::array();
        for (json& node : out_["nodes"]) node.erase("mesh");
        make_scene(out_);
        meshes_ = out_.value("meshes", json::array());
        std::size_t empty = 0;
        for (const LevelCuts& levels : all) {
            if (const auto valid = check(name, levels); !valid) return valid;
            if (levels.cuts[0]->triangle_count() == 0) ++empty;
            else if (const auto added = add(levels); !added) return added;
        }
        if (empty > 0)
            result_.notes.push_back(counted_were(empty, "node") + " left without a mesh: there is no triangle.");
        if (written_.empty()) return failed_to_write(name, "no triangle is left.");
        out_["meshes"] = std::move(written_);
        SourceDocument images;
        images.files = source_.files;
        if (const auto written = write_beside(name, images, result_.notes); !written) return written;
        add_images(out_, images, file_);
        return file_.write(name, std::move(out_));
    }

private:
    Result<void> add(const LevelCuts& levels) {
        json& nodes = out_["nodes"];
        auto node = static_cast<std::size_t>(levels.node);
        if (levels.node < 0) {
            node = nodes.size();
            nodes.push_back(json::object());
            shown_scene(out_)["nodes"].push_back(node);
        }
        const auto first = mesh_of(levels, 0);
        if (!first) return first.error();
        if (levels.cuts.size() == 1) {
            show(nodes, node, *first);
            return {};
        }
        if (!is_only_a_place(nodes.at(node))) {
            json holder = json::object();
            if (nodes[node].contains("name")) holder["name"] = nodes[node]["name"];
            nodes[node]["children"].push_back(nodes.size());
            node = nodes.size();
            nodes.push_back(std::move(holder));
        }
        json place = json::object(); // that levels are shown at
        for (const char* key : {"matrix", "translation", "rotation", "scale"})
            if (nodes[node].contains(key)) place[key] = nodes[node][key];
        std::vector<std::size_t> ids;
        for (std::size_t level = 1; level < levels.cuts.size(); ++level) {
            const auto mesh = mesh_of(levels, level);
            if (!mesh) return mesh.error();
            json further = place;
            further["name"] = level_name(nodes[node], level);
            ids.push_back(nodes.size());
            nodes.push_back(std::move(further));
            show(nodes, ids.back(), *mesh);
        }
        show(nodes, node, *first);
        tell_levels(out_, node, ids, levels.coverages);
        return {};
    }

    // What another level replaces must be the mesh alone, not children, cameras and lights.
    static bool is_only_a_place(const json& node) {
        for (const auto& [key, value] : node.items()) {
            constexpr std::string_view plain[] = {"name", "matrix", "translation", "rotation", "scale"};
            const bool is_extras = key == "extras" && value.is_object();
            if (!is_extras && std::find(std::begin(plain), std::end(plain), key) == std::end(plain)) return false;
        }
        return true;
    }

    Result<WrittenMesh> mesh_of(const LevelCuts& levels, std::size_t level) {
        const vdtree::Cut& cut = *levels.cuts[level];
        const auto [known, is_new] = known_.try_emplace({&cut, levels.mesh});
        if (!is_new) return known->second;
        const std::uint64_t before = file_.bytes();
        const auto document = unpack(cut.tree().document());
        if (!document) return document.error();
        if (document->format != SourceDocument::Format::gltf) gltf::fail("it is of another format.");
        auto restored = restore(cut, extract_with_sources(cut), *document, drawn_uvs(*document));
        if (!restored) return restored.error();
        parts_.push_back(std::move(*restored));
        std::sort(parts_.back().begin(), parts_.back().end(), [&](const RestoredPart& a, const RestoredPart& b) {
            return document->parts[a.part].primitive < document->parts[b.part].primitive;
        });
        std::vector<RestoredPart*> all;
        for (RestoredPart& part : parts_.back()) all.push_back(&part);
        known->second.grid = grid_of(file_, all);
        json mesh = meshes_.at(static_cast<std::size_t>(levels.mesh));
        json primitives = json::array();
        for (RestoredPart* part : all) {
            json primitive = mesh.at("primitives").at(static_cast<std::size_t>(document->parts[part->part].primitive));
            primitive.update(gltf_primitive(*part, *document, file_, known->second.grid));
            primitives.push_back(std::move(primitive));
        }
        mesh["primitives"] = std::move(primitives);
        if (level > 0 && mesh.contains("name")) mesh["name"] = level_name(mesh, level);
        known->second.number = written_.size();
        written_.push_back(std::move(mesh));
        result_.bytes.resize(std::max(result_.bytes.size(), level + 1));
        result_.bytes[level] += file_.bytes() - before;
        return known->second;
    }

    const SceneSource& source_;
    LevelsWritten& result_;
    GltfFile file_;
    std::deque<std::vector<RestoredPart>> parts_; // which the file refers to
    std::map<std::pair<const vdtree::Cut*, std::int32_t>, WrittenMesh> known_;
    json out_, meshes_, written_ = json::array();
};

// ---- models

// The document of a mesh that came without one: one node.
SourceDocument plain_document() {
    SourceDocument document;
    document.json = R"({"scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{}]})";
    return document;
}

class ModelLevelWriter {
public:
    ModelLevelWriter(const GltfOptions& options, LevelsWritten& result) : result_(result), file_(options) {}

    Result<void> write(const fs::path& name, const LevelCuts& levels) {
        if (const auto valid = check(name, levels); !valid) return valid;
        const auto bytes = levels.cuts[0]->tree().document();
        std::optional<SourceDocument> document;
        if (!bytes.empty()) {
            auto unpacked = unpack(bytes);
            if (!unpacked) return unpacked.error();
            if (unpacked->format != SourceDocument::Format::table) document = std::move(*unpacked);
        }
        is_plain_ = !document;
        if (is_plain_) {
            document = plain_document();
        } else {
            uvs_ = drawn_uvs(*document);
            auto converted = as_gltf(std::move(*document), result_.notes);
            if (!converted) return converted.error();
            document = std::move(*converted);
        }
        out_ = gltf::parse_json(document->json);
        if (!out_.contains("nodes")) out_["nodes"] = json::array();
        for (json& node : out_["nodes"]) node.erase("mesh");
        make_scene(out_);
        meshes_ = out_.value("meshes", json::array());
        for (std::size_t level = 0; level < levels.cuts.size(); ++level) {
            const std::uint64_t before = file_.bytes();
            const auto added = add(name, *levels.cuts[level], level, *document);
            if (!added) return added;
            result_.bytes.push_back(file_.bytes() - before);
        }
        if (levels.cuts.size() > 1) {
            // One root above all, for another level replaces everything.
            json& scene = shown_scene(out_);
            json root = {{"name", name.stem().string()}, {"children", scene["nodes"]}};
            const std::size_t first = out_["nodes"].size();
            out_["nodes"].push_back(std::move(root));
            scene["nodes"] = json::array({first});
            std::vector<std::size_t> ids;
            for (std::size_t i = 0; i < further_.size(); ++i) {
                ids.push_back(out_["nodes"].size());
                out_["nodes"].push_back({{"name", level_name(out_["nodes"][first], i + 1)}, {"children", further_[i]}});
            }
            tell_levels(out_, first, ids, levels.coverages);
        }
        out_["meshes"] = std::move(written_);
        if (const auto written = write_beside(name, *document, result_.notes); !written) return written;
        add_images(out_, *document, file_);
        return file_.write(name, std::move(out_));
    }

private:
    Result<void> add(const fs::path& name, const vdtree::Cut& cut, std::size_t level, const SourceDocument& document) {
        const ExtractedMesh extracted = extract_with_sources(cut);
        if (extracted.mesh.triangles.empty()) return failed_to_write(name, "the model has no triangles.");
        if (is_plain_) return add_plain(extracted.mesh, level);
        auto restored = restore(cut, extracted, document, uvs_);
        if (!restored) return restored.error();
        parts_.push_back(std::move(*restored));
        std::map<std::tuple<std::int32_t, std::int32_t>, std::vector<RestoredPart*>> meshes; // by mesh and node
        for (RestoredPart& part : parts_.back())
            meshes[{document.parts[part.part].mesh, document.parts[part.part].node}].push_back(&part);
        json& nodes = out_["nodes"];
        for (auto& [key, parts] : meshes) {
            std::sort(parts.begin(), parts.end(), [&](const RestoredPart* a, const RestoredPart* b) {
                return document.parts[a->part].primitive < document.parts[b->part].primitive;
            });
            const SourceDocument::Part& part = document.parts[parts[0]->part];
            json mesh = meshes_.at(static_cast<std::size_t>(part.mesh));
            const json source = mesh.at("primitives");
            const GltfGrid grid = grid_of(file_, parts);
            mesh["primitives"] = json::array();
            for (RestoredPart* of : parts) {
                json primitive = source.at(static_cast<std::size_t>(document.parts[of->part].primitive));
                primitive.update(gltf_primitive(*of, document, file_, grid));
                mesh["primitives"].push_back(std::move(primitive));
            }
            std::size_t node = 0;
            if (level == 0) {
                node = node_for(out_, part, *parts[0], result_.notes);
            } else {
                json further = json::object();
                if (mesh.contains("name")) mesh["name"] = level_name(mesh, level);
                if (part.node >= 0) further["name"] = level_name(nodes.at(static_cast<std::size_t>(part.node)), level);
                if (!parts[0]->is_in_world && part.to_world != glm::dmat4(1))
                    for (int i = 0; i < 16; ++i) further["matrix"].push_back(part.to_world[i / 4][i % 4]);
                node = nodes.size();
                nodes.push_back(std::move(further));
                children_of(level).push_back(node);
            }
            show(nodes, node, {written_.size(), grid});
            written_.push_back(std::move(mesh));
        }
        return {};
    }

    // Of PLY and the like: what the mesh itself has.
    Result<void> add_plain(const vdtree::Mesh& mesh, std::size_t level) {
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
        const GltfGrid grid = grid_of(file_, {&part});
        json& nodes = out_["nodes"];
        std::size_t node = 0;
        if (level > 0) {
            node = nodes.size();
            nodes.push_back(json::object());
            children_of(level).push_back(node);
        }
        if (origin_ != glm::dvec3(0)) nodes[node]["translation"] = {origin_.x, origin_.y, origin_.z};
        show(nodes, node, {written_.size(), grid});
        written_.push_back({{"primitives", json::array({gltf_primitive(part, document, file_, grid)})}});
        return {};
    }

    std::vector<std::size_t>& children_of(std::size_t level) {
        further_.resize(std::max(further_.size(), level));
        return further_[level - 1];
    }

    LevelsWritten& result_;
    GltfFile file_;
    bool is_plain_ = false;
    glm::dvec3 origin_ = glm::dvec3(0); // of plain meshes
    std::vector<std::string> uvs_;
    std::deque<std::vector<RestoredPart>> parts_;   // which the file refers to
    std::vector<std::vector<std::size_t>> further_; // nodes of levels 1 and on
    json out_, meshes_, written_ = json::array();
};

} // namespace

Result<LevelsWritten> write_scene_levels(const fs::path& file, const SceneSource& source,
                                         std::span<const LevelCuts> levels, const GltfOptions& options) {
    LevelsWritten result;
    const auto written = guarded_writing(
        [&]() -> Result<void> { return SceneLevelWriter(source, options, result).write(file, levels); });
    if (!written) return written.error();
    return result;
}

Result<LevelsWritten> write_model_levels(const fs::path& file, const LevelCuts& levels, const GltfOptions& options) {
    LevelsWritten result;
    const auto written =
        guarded_writing([&]() -> Result<void> { return ModelLevelWriter(options, result).write(file, levels); });
    if (!written) return written.error();
    return result;
}

} // namespace unseen::meshio
