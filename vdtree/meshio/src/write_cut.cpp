// Cuts with all that the file of their mesh said.
#include "write_cut.h"

#include <map>
#include <system_error>

#include <unseen/meshio/scene_file.h>

#include "kept_arrays.h"
#include "mesh_writers.h"
#include "obj_lines.h"
#include "restore.h"

namespace unseen::meshio {

namespace fs = std::filesystem;

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

namespace {

// ---- OBJ

class ObjWriter {
public:
    ObjWriter(FileOutput& out, const VertexTree& tree, const ExtractedMesh& extracted, const SourceDocument& document,
              const std::vector<RestoredPart>& parts)
        : out_(out), tree_(tree), extracted_(extracted), document_(document), parts_(parts) {}

    void write() {
        for (const File& file : document_.files)
            if (file.use == File::Use::library) out_.text("mtllib " + one_line(file.uri) + "\n");
        const std::vector<glm::vec4> colours = colours_of_vertices();
        const ObjLines positions(nodes_of(tree_, extracted_), colours);
        write_positions(positions, colours);
        std::vector<glm::vec2> uvs;
        std::vector<glm::vec3> normals;
        for (const RestoredPart& restored : parts_) {
            append(uvs, restored.uvs, restored);
            append(normals, "NORMAL", restored);
        }
        const ObjLines uv_lines{std::span<const glm::vec2>(uvs)}, normal_lines{std::span<const glm::vec3>(normals)};
        uv_lines.write(out_, "vt", uvs, 2);
        normal_lines.write(out_, "vn", normals, 3);
        write_faces(positions, uv_lines, normal_lines);
    }

private:
    void write_faces(const ObjLines& positions, const ObjLines& uvs, const ObjLines& normals) {
        const SourceDocument::Part* before = nullptr;
        std::size_t first_uv = 0, first_normal = 0;
        for (const RestoredPart& restored : parts_) {
            const SourceDocument::Part& part = document_.parts[restored.part];
            write_name("o", part.object, before ? before->object : std::string());
            write_name("g", part.group, before ? before->group : std::string());
            write_name("usemtl", part.material, before ? before->material : std::string());
            before = &part;
            const bool has_uvs = channel(restored.uvs, 2, restored), has_normals = channel("NORMAL", 3, restored);
            for (const Triangle& triangle : restored.triangles) {
                out_.text("f");
                for (const Index corner : triangle)
                    write_obj_corner(out_, positions.number(restored.vertices[corner]),
                                     has_uvs ? uvs.number(first_uv + corner) : 0,
                                     has_normals ? normals.number(first_normal + corner) : 0);
                out_.text("\n");
            }
            if (has_uvs) first_uv += restored.vertices.size();
            if (has_normals) first_normal += restored.vertices.size();
        }
    }

    // Of so many components at least; null: the part has it not.
    const std::vector<float>* channel(const std::string& name, std::size_t least, const RestoredPart& restored,
                                      std::size_t* components = nullptr) const {
        for (std::size_t c = 0; c < restored.channels.size(); ++c) {
            const SourceDocument::Channel& channel = document_.channels[c];
            if (channel.name != name || channel.components < least || restored.channels[c].empty()) continue;
            if (components) *components = channel.components;
            return &restored.channels[c];
        }
        return nullptr;
    }

    template <class Vector>
    void append(std::vector<Vector>& to, const std::string& name, const RestoredPart& restored) const {
        std::size_t components = 0;
        const std::vector<float>* values = channel(name, Vector::length(), restored, &components);
        for (std::size_t i = 0; values && i < values->size(); i += components) {
            Vector& value = to.emplace_back();
            for (int k = 0; k < Vector::length(); ++k) value[k] = (*values)[i + static_cast<std::size_t>(k)];
        }
    }

    // Empty: there are none. A vertex without one has none.
    std::vector<glm::vec4> colours_of_vertices() const {
        std::vector<glm::vec4> colours;
        for (const RestoredPart& restored : parts_) {
            std::size_t components = 0;
            const std::vector<float>* values = channel("COLOR_0", 1, restored, &components);
            if (!values) continue;
            colours.resize(extracted_.wedges.size(), none);
            for (std::size_t i = 0; i < restored.vertices.size(); ++i) {
                glm::vec4& colour = colours[restored.vertices[i]] = missing_colour;
                for (std::size_t k = 0; k < components; ++k)
                    colour[static_cast<int>(k)] = (*values)[i * components + k];
            }
        }
        return colours;
    }

    void write_positions(const ObjLines& positions, const std::vector<glm::vec4>& colours) {
        const bool has_alpha =
            std::any_of(colours.begin(), colours.end(), [&](glm::vec4 c) { return c != none && c.a != 1; });
        positions.for_each([&](std::size_t v) {
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
        });
    }

    void write_name(const char* keyword, const std::string& name, const std::string& before) {
        if (name != before) out_.text(std::string(keyword) + " " + one_line(name) + "\n");
    }

    static constexpr glm::vec4 none = glm::vec4(-1);

    FileOutput& out_;
    const VertexTree& tree_;
    const ExtractedMesh& extracted_;
    const SourceDocument& document_;
    const std::vector<RestoredPart>& parts_;
};

// ---- any format

Result<void> write_document(const fs::path& file, const Cut& cut, SourceDocument document,
                            std::vector<Message>& notes) {
    const Format* const format = format_named(file);
    if (format == nullptr) return write_mesh(file, {}); // which says what endings there are
    if (is_gltf_file(file)) {
        auto written = write_model_levels(file, {.cuts = {&cut}, .coverages = {0}});
        if (!written) return written.error();
        notes = std::move(written->notes);
        return {};
    }
    const std::vector<std::string> uvs = drawn_uvs(document);
    document = as_obj(std::move(document), file.stem().string(), notes);
    ExtractedMesh extracted = extract_with_sources(cut);
    if (extracted.mesh.triangles.empty())
        return failed_to_write(file, "the cut has no triangles, and no format holds materials of nothing.");
    const auto parts = restore(cut, extracted, document, uvs);
    if (!parts) return parts.error();
    if (!format->holds_materials) {
        notes.assign(1, std::string(format->name) +
                            " holds no materials, images and nodes; write glTF or OBJ to keep them.");
        for (std::size_t c = 0; c < document.channels.size(); ++c)
            for (const RestoredPart& part : *parts)
                if (document.channels[c].name == part.uvs)
                    for (std::size_t i = 0; 2 * i < part.channels[c].size(); ++i)
                        extracted.mesh.uvs.at(part.vertices[i]) = {part.channels[c][2 * i],
                                                                   part.channels[c][2 * i + 1]};
        return write_mesh_with(file, extracted.mesh.view(), {}, notes);
    }
    if (const auto written = write_beside(file, document, notes); !written) return written;
    return write_file(file, [&](FileOutput& out) { ObjWriter(out, cut.tree(), extracted, document, *parts).write(); });
}

Result<void> write_table(const fs::path& file, const Cut& cut, const SourceDocument& document,
                         std::vector<Message>& notes) {
    const ExtractedMesh extracted = extract_with_sources(cut);
    const Format* const format = format_named(file);
    const bool is_held = format != nullptr && format->holds_values;
    const auto arrays =
        is_held ? arrays_of_cut(cut, extracted, document.arrays) : Result<std::vector<VertexArray>>(document.arrays);
    if (!arrays) return arrays.error();
    return write_mesh_with(file, extracted.mesh.view(), *arrays, notes, {}, nodes_of(cut.tree(), extracted));
}

} // namespace

Result<std::vector<Message>> write_cut(const fs::path& file, const Cut& cut) {
    std::vector<Message> notes;
    const auto bytes = cut.tree().document();
    Result<void> written;
    if (bytes.empty()) {
        const ExtractedMesh extracted = extract_with_sources(cut);
        written = write_mesh_with(file, extracted.mesh.view(), {}, notes, {}, nodes_of(cut.tree(), extracted));
    } else {
        written = guarded_writing([&]() -> Result<void> {
            auto document = document_of(cut.tree());
            if (!document) return document.error();
            if (document->format == SourceDocument::Format::table) return write_table(file, cut, *document, notes);
            return write_document(file, cut, std::move(*document), notes);
        });
    }
    if (!written) return written.error();
    return notes;
}

} // namespace unseen::meshio
