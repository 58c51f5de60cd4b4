// Cuts with all that the file of their mesh said.
#include <algorithm>
#include <deque>
#include <map>
#include <set>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <unseen/meshio/mesh_file.h>
#include <unseen/meshio/scene_file.h>
#include <unseen/vdtree/colour.h>

#include "file_output.h"
#include "formats.h"
#include "gltf_data.h"
#include "gltf_document.h"
#include "gltf_parts.h"
#include "gltf_writer.h"
#include "kept_arrays.h"
#include "material_formats.h"
#include "mesh_readers.h"
#include "mesh_writers.h"
#include "restore.h"

namespace unseen::meshio {

namespace fs = std::filesystem;
using nlohmann::json;
using vdtree::AtomicFile;

namespace {

using File = SourceDocument::File;

// ---- files beside the mesh

// Nothing but images and libraries is written, and nothing hidden: the names come from a file that nobody vouches for.
bool may_be_written(const fs::path& path) {
    constexpr std::string_view endings[] = {".png",  ".jpg",   ".jpeg", ".webp", ".avif", ".ktx",
                                            ".ktx2", ".basis", ".dds",  ".tga",  ".bmp",  ".tif",
                                            ".tiff", ".gif",   ".hdr",  ".exr",  ".pfm",  ".mtl"};
    const bool is_hidden =
        std::any_of(path.begin(), path.end(), [](const fs::path& name) { return name.string().starts_with('.'); });
    return !is_hidden && std::find(std::begin(endings), std::end(endings), lower_ending(path)) != std::end(endings);
}

// ---- glTF

std::string media_type(std::string_view bytes) {
    if (bytes.starts_with("\x89PNG")) return "image/png";
    if (bytes.starts_with("\xFF\xD8\xFF")) return "image/jpeg";
    return "application/octet-stream";
}

} // namespace

Error failed_to_write(const fs::path& file, const std::string& why) {
    return {ErrorCode::io_failure, "Cannot write '" + file.string() + "': " + why};
}

Result<void> write_beside(const fs::path& file, const SourceDocument& document, std::vector<Message>& notes) {
    std::map<fs::path, const std::string*> missing;
    for (const File& beside : document.files) {
        if (beside.uri.empty() || !beside.bytes) continue;
        const bool is_gltf = document.format == SourceDocument::Format::gltf;
        const auto path = path_beside(is_gltf ? decode_percent(beside.uri) : beside.uri);
        if (!path) continue; // a file elsewhere, of which the name is all there is
        if (!may_be_written(*path)) {
            notes.push_back(in_quotes(path->string()) + " is no usual name of an image or library: it was not copied.");
            continue;
        }
        const fs::path target = file.parent_path() / *path;
        std::error_code unknown;
        if (!fs::exists(target, unknown)) {
            missing.emplace(target, beside.bytes.get());
            continue;
        }
        const auto there = read_regular_file(target);
        if (!there) return there.error();
        if (*there != *beside.bytes)
            return failed_to_write(target, "another file of that name is there; write the mesh to another folder.");
    }
    for (const auto& [target, bytes] : missing) {
        std::error_code failed;
        if (target.has_parent_path()) fs::create_directories(target.parent_path(), failed);
        if (failed) return failed_to_write(target, failed.message() + ".");
        auto out = AtomicFile::create(target);
        if (!out) return out.error();
        if (const auto written = out->write(std::string_view(*bytes)); !written) return written;
        if (const auto done = out->commit(); !done) return done;
    }
    return {};
}

void add_images(json& out, const SourceDocument& document, GltfFile& file) {
    if (!out.contains("images")) return;
    json& images = out["images"];
    for (std::size_t i = 0; i < images.size() && i < document.files.size(); ++i) {
        const File& image = document.files[i];
        if (!image.uri.empty() || !image.bytes) continue;
        images[i]["bufferView"] = file.add_bytes(*image.bytes);
        if (!images[i].contains("mimeType")) images[i]["mimeType"] = media_type(*image.bytes);
    }
}

json gltf_primitive(RestoredPart& restored, const SourceDocument& document, GltfFile& file, const GltfGrid& grid) {
    if (file.reorders()) {
        GltfOrder order = optimized(restored.triangles, restored.positions.size());
        const auto sorted = [&](auto& values, std::size_t components) {
            auto old = std::move(values);
            values.clear();
            for (const Index v : order.vertices)
                values.insert(values.end(), old.begin() + static_cast<std::ptrdiff_t>(v * components),
                              old.begin() + static_cast<std::ptrdiff_t>((v + 1) * components));
        };
        restored.triangles = std::move(order.triangles);
        sorted(restored.positions, 1), sorted(restored.vertices, 1);
        for (std::size_t c = 0; c < restored.channels.size(); ++c)
            if (!restored.channels[c].empty()) sorted(restored.channels[c], document.channels[c].components);
    }
    json attributes = {{"POSITION", file.add_positions(restored.positions, grid)}};
    for (std::size_t c = 0; c < restored.channels.size(); ++c)
        if (!restored.channels[c].empty())
            attributes[document.channels[c].name] =
                file.add_attribute(document.channels[c].name, restored.channels[c], document.channels[c].components);
    return file.primitive(attributes, file.add_indices(restored.triangles), 0, restored.triangles.size());
}

std::size_t node_for(json& out, const SourceDocument::Part& part, const RestoredPart& restored,
                     std::vector<Message>& notes) {
    json& nodes = out["nodes"];
    const bool is_known = part.node >= 0 && static_cast<std::size_t>(part.node) < nodes.size();
    if (is_known && !restored.is_in_world) return static_cast<std::size_t>(part.node);
    json node = json::object();
    const json& named =
        is_known ? nodes[static_cast<std::size_t>(part.node)] : out["meshes"].at(static_cast<std::size_t>(part.mesh));
    if (named.contains("name")) node["name"] = named["name"];
    if (is_known) notes.push_back("a node whose transform has no inverse got a copy beside it, which has the mesh.");
    nodes.push_back(std::move(node));
    if (is_known && !out.contains("scenes")) return nodes.size() - 1; // all are shown
    json& scenes = out["scenes"];
    if (!scenes.is_array() || scenes.empty()) scenes = json::array({json::object()});
    const std::size_t scene = out.value("scene", std::size_t{0});
    scenes.at(scene)["nodes"].push_back(nodes.size() - 1);
    return nodes.size() - 1;
}

namespace {

Result<void> write_gltf(const fs::path& name, const SourceDocument& document, std::vector<RestoredPart>& parts,
                        std::vector<Message>& notes) {
    GltfFile file;
    json out = gltf::parse_json(document.json);
    if (!out.contains("nodes")) out["nodes"] = json::array();
    for (json& node : out["nodes"]) node.erase("mesh");
    const json meshes = out.value("meshes", json::array());
    // In the order of the document's meshes, then of its nodes.
    std::sort(parts.begin(), parts.end(), [&](const RestoredPart& a, const RestoredPart& b) {
        const auto key = [&](const RestoredPart& p) {
            const SourceDocument::Part& part = document.parts[p.part];
            return std::tuple(part.mesh, part.node, part.primitive, p.part);
        };
        return key(a) < key(b);
    });
    json written = json::array();
    std::map<std::pair<std::int32_t, std::int32_t>, std::size_t> numbers; // by mesh and node
    std::map<std::int32_t, std::size_t> copies;
    for (RestoredPart& restored : parts) {
        const SourceDocument::Part& part = document.parts[restored.part];
        const json& mesh = meshes.at(static_cast<std::size_t>(part.mesh));
        const auto [number, is_new] = numbers.try_emplace({part.mesh, part.node}, written.size());
        if (is_new) {
            json copy = mesh;
            copy["primitives"] = json::array();
            written.push_back(std::move(copy));
            ++copies[part.mesh];
            out["nodes"].at(node_for(out, part, restored, notes))["mesh"] = number->second;
        }
        json primitive = mesh.at("primitives").at(static_cast<std::size_t>(part.primitive));
        primitive.update(gltf_primitive(restored, document, file));
        written[number->second]["primitives"].push_back(std::move(primitive));
    }
    const auto instances = std::count_if(copies.begin(), copies.end(), [](const auto& of) { return of.second > 1; });
    if (instances > 0)
        notes.push_back(counted_were(static_cast<std::uint64_t>(instances), "mesh") +
                        " under several nodes; each node has a mesh of its own now.");
    out["meshes"] = std::move(written);
    add_images(out, document, file);
    return file.write(name, std::move(out));
}

// ---- OBJ

class ObjWriter {
public:
    ObjWriter(FileOutput& out, const ExtractedMesh& extracted, const SourceDocument& document,
              const std::vector<RestoredPart>& parts)
        : out_(out), extracted_(extracted), document_(document), parts_(parts) {}

    void write() {
        for (const File& file : document_.files)
            if (file.use == File::Use::library) out_.text("mtllib " + one_line(file.uri) + "\n");
        write_positions();
        const SourceDocument::Part* before = nullptr;
        for (const RestoredPart& restored : parts_) {
            const SourceDocument::Part& part = document_.parts[restored.part];
            const std::uint64_t first_uv = write_vectors("vt", restored.uvs, restored, uvs_);
            const std::uint64_t first_normal = write_vectors("vn", "NORMAL", restored, normals_);
            write_name("o", part.object, before ? before->object : std::string());
            write_name("g", part.group, before ? before->group : std::string());
            write_name("usemtl", part.material, before ? before->material : std::string());
            before = &part;
            for (const Triangle& triangle : restored.triangles) {
                out_.text("f");
                for (const Index corner : triangle) {
                    out_.text(" ");
                    out_.number(std::uint64_t{restored.vertices[corner]} + 1);
                    if (first_uv || first_normal) out_.text("/");
                    if (first_uv) out_.number(first_uv + corner);
                    if (first_normal) out_.text("/");
                    if (first_normal) out_.number(first_normal + corner);
                }
                out_.text("\n");
            }
        }
    }

private:
    const std::vector<float>* channel(const std::string& name, const RestoredPart& restored,
                                      std::size_t& components) const {
        for (std::size_t c = 0; c < restored.channels.size(); ++c) {
            if (document_.channels[c].name != name || restored.channels[c].empty()) continue;
            components = document_.channels[c].components;
            return &restored.channels[c];
        }
        return nullptr;
    }

    void write_positions() {
        constexpr glm::vec4 none(-1);
        std::vector<glm::vec4> colours;
        for (const RestoredPart& restored : parts_) {
            std::size_t components = 0;
            const std::vector<float>* values = channel("COLOR_0", restored, components);
            if (!values) continue;
            colours.resize(extracted_.nodes.size(), none);
            for (std::size_t i = 0; i < restored.vertices.size(); ++i) {
                glm::vec4& colour = colours[restored.vertices[i]] = missing_colour;
                for (std::size_t k = 0; k < components; ++k)
                    colour[static_cast<int>(k)] = (*values)[i * components + k];
            }
        }
        const bool has_alpha =
            std::any_of(colours.begin(), colours.end(), [&](glm::vec4 c) { return c != none && c.a != 1; });
        for (std::size_t v = 0; v < extracted_.nodes.size(); ++v) {
            out_.text("v");
            for (int k = 0; k < 3; ++k) { // floats in as few digits as theirs
                const double x = extracted_.mesh.positions[v][k];
                out_.text(" ");
                if (static_cast<double>(static_cast<float>(x)) == x) out_.number(static_cast<float>(x));
                else out_.number(x);
            }
            for (int k = 0; !colours.empty() && colours[v] != none && k < (has_alpha ? 4 : 3); ++k) {
                out_.text(" ");
                out_.number(k < 3 ? linear_to_srgb(colours[v][k]) : colours[v].a);
            }
            out_.text("\n");
        }
    }

    // The number of the first, or 0: there are none.
    std::uint64_t write_vectors(const char* keyword, const std::string& name, const RestoredPart& restored,
                                std::uint64_t& count) {
        std::size_t components = 0;
        const std::vector<float>* values = channel(name, restored, components);
        if (!values) return 0;
        for (std::size_t i = 0; i < values->size(); i += components) {
            out_.text(keyword);
            for (std::size_t k = 0; k < components; ++k) {
                out_.text(" ");
                out_.number((*values)[i + k]);
            }
            out_.text("\n");
        }
        return std::exchange(count, count + values->size() / components) + 1;
    }

    void write_name(const char* keyword, const std::string& name, const std::string& before) {
        if (name != before) out_.text(std::string(keyword) + " " + one_line(name) + "\n");
    }

    FileOutput& out_;
    const ExtractedMesh& extracted_;
    const SourceDocument& document_;
    const std::vector<RestoredPart>& parts_;
    std::uint64_t uvs_ = 0, normals_ = 0; // so far
};

// ---- any format

Result<void> write_document(const fs::path& file, const Cut& cut, SourceDocument document,
                            std::vector<Message>& notes) {
    const Format* const format = format_named(file);
    if (format == nullptr) return write_mesh(file, {}); // which says what endings there are
    const bool is_gltf = format->read == read_gltf;
    const std::vector<std::string> uvs = drawn_uvs(document);
    auto converted =
        is_gltf ? as_gltf(std::move(document), notes) : as_obj(std::move(document), file.stem().string(), notes);
    if (!converted) return converted.error();
    ExtractedMesh extracted = extract_with_sources(cut);
    if (extracted.mesh.triangles.empty())
        return failed_to_write(file, "the cut has no triangles, and no format holds materials of nothing.");
    auto parts = restore(cut, extracted, *converted, uvs);
    if (!parts) return parts.error();
    if (!format->holds_materials) {
        notes.assign(1, std::string(format->name) +
                            " holds no materials, images and nodes; write glTF or OBJ to keep them.");
        for (std::size_t c = 0; c < converted->channels.size(); ++c)
            for (const RestoredPart& part : *parts)
                if (converted->channels[c].name == part.uvs)
                    for (std::size_t i = 0; 2 * i < part.channels[c].size(); ++i)
                        extracted.mesh.uvs.at(part.vertices[i]) = {part.channels[c][2 * i],
                                                                   part.channels[c][2 * i + 1]};
        return write_mesh_with(file, extracted.mesh.view(), {}, notes);
    }
    if (const auto written = write_beside(file, *converted, notes); !written) return written;
    if (is_gltf) return write_gltf(file, *converted, *parts, notes);
    return write_file(file, [&](FileOutput& out) -> Result<void> {
        ObjWriter(out, extracted, *converted, *parts).write();
        return {};
    });
}

Result<void> write_table(const fs::path& file, const Cut& cut, const SourceDocument& document,
                         std::vector<Message>& notes) {
    const ExtractedMesh extracted = extract_with_sources(cut);
    const Format* const format = format_named(file);
    const bool is_held = format != nullptr && format->holds_values;
    const auto arrays =
        is_held ? arrays_of_cut(cut, extracted, document.arrays) : Result<std::vector<VertexArray>>(document.arrays);
    if (!arrays) return arrays.error();
    return write_mesh_with(file, extracted.mesh.view(), *arrays, notes);
}

// ---- scenes

// Whether nothing is folded, not even what leaves no triangle out.
bool is_whole(const Cut& cut) {
    const VertexTree& tree = cut.tree();
    for (Index leaf = 0; leaf < tree.leaf_count(); ++leaf)
        if (!tree.is_leaf(cut.proxy_of_leaf(leaf))) return false;
    return true;
}

// Puts the meshes of cuts into a scene's document.
class SceneWriter {
public:
    SceneWriter(const SceneSource& source, std::vector<Message>& notes) : source_(source), notes_(notes) {}

    Result<void> write(const fs::path& file, std::span<const SceneCut> cuts) {
        out_ = gltf::parse_json(source_.json);
        if (!out_.contains("nodes")) out_["nodes"] = json::array();
        for (json& node : out_["nodes"]) node.erase("mesh");
        meshes_ = out_.value("meshes", json::array());
        for (const SceneCut& cut : cuts)
            if (const auto added = add(cut); !added) return added;
        if (empty_ > 0)
            notes_.push_back(std::to_string(empty_) + (empty_ == 1 ? " node has" : " nodes have") +
                             " no triangle left, and no mesh any more.");
        if (written_.empty()) return failed_to_write(file, "no triangle is left; move nearer or allow more triangles.");
        out_["meshes"] = std::move(written_);
        SourceDocument images;
        images.files = source_.files;
        if (const auto written = write_beside(file, images, notes_); !written) return written;
        add_images(out_, images, file_);
        return file_.write(file, std::move(out_));
    }

private:
    Result<void> add(const SceneCut& cut) {
        if (cut.cut->triangle_count() == 0) {
            ++empty_;
            return {};
        }
        ExtractedMesh extracted = extract_with_sources(*cut.cut);
        // The same vertices of one tree are one mesh. Trees that differ by a stretch alone are the same mesh if nothing
        // is folded.
        const bool is_all = is_whole(*cut.cut);
        Look look{cut.mesh, is_all ? nullptr : cut.cut->tree().positions().data(), {}};
        if (!is_all) look.vertices = extracted.nodes;
        auto known = written_as_.find(look);
        if (known == written_as_.end()) {
            const auto made = mesh_of(cut, std::move(extracted));
            if (!made) return made.error();
            known = written_as_.emplace(std::move(look), *made).first;
        }
        const std::size_t number = known->second;
        if (cut.node >= 0) {
            out_["nodes"].at(static_cast<std::size_t>(cut.node))["mesh"] = number;
            return {};
        }
        out_["nodes"].push_back({{"mesh", number}});
        if (!out_.contains("scenes") || out_["scenes"].empty()) return {}; // all are shown
        out_["scenes"].at(out_.value("scene", std::size_t{0}))["nodes"].push_back(out_["nodes"].size() - 1);
        return {};
    }

    // What a mesh of the output is of.
    struct Look {
        std::int32_t mesh;
        const void* tree;
        std::vector<NodeId> vertices;
        auto operator<=>(const Look&) const = default;
    };

    Result<std::size_t> mesh_of(const SceneCut& cut, ExtractedMesh extracted) {
        const auto document = unpack(cut.cut->tree().document());
        if (!document) return document.error();
        if (document->format != SourceDocument::Format::gltf) gltf::fail("it is of another format.");
        auto restored = restore(*cut.cut, extracted, *document, drawn_uvs(*document));
        if (!restored) return restored.error();
        parts_.push_back(std::move(*restored));
        std::sort(parts_.back().begin(), parts_.back().end(), [&](const RestoredPart& a, const RestoredPart& b) {
            return document->parts[a.part].primitive < document->parts[b.part].primitive;
        });
        json mesh = meshes_.at(static_cast<std::size_t>(cut.mesh));
        json primitives = json::array();
        for (RestoredPart& part : parts_.back()) {
            json primitive = mesh.at("primitives").at(static_cast<std::size_t>(document->parts[part.part].primitive));
            primitive.update(gltf_primitive(part, *document, file_));
            primitives.push_back(std::move(primitive));
        }
        mesh["primitives"] = std::move(primitives);
        written_.push_back(std::move(mesh));
        return written_.size() - 1;
    }

    const SceneSource& source_;
    std::vector<Message>& notes_;
    GltfFile file_;
    std::deque<std::vector<RestoredPart>> parts_; // which the file refers to
    json out_, meshes_, written_ = json::array();
    std::map<Look, std::size_t> written_as_;
    std::size_t empty_ = 0;
};

} // namespace

Result<std::vector<Message>> write_scene(const fs::path& file, const SceneSource& source,
                                         std::span<const SceneCut> cuts) {
    std::vector<Message> notes;
    const auto written =
        guarded_writing([&]() -> Result<void> { return SceneWriter(source, notes).write(file, cuts); });
    if (!written) return written.error();
    return notes;
}

Result<std::vector<Message>> write_cut(const fs::path& file, const Cut& cut) {
    std::vector<Message> notes;
    const auto bytes = cut.tree().document();
    Result<void> written;
    if (bytes.empty()) {
        written = write_mesh_with(file, extract_mesh(cut).view(), {}, notes);
    } else {
        written = guarded_writing([&]() -> Result<void> {
            auto document = unpack(bytes);
            if (!document) return document.error();
            if (document->format == SourceDocument::Format::table) return write_table(file, cut, *document, notes);
            return write_document(file, cut, std::move(*document), notes);
        });
    }
    if (!written) return written.error();
    return notes;
}

} // namespace unseen::meshio
