// Finds out what a file is, has it read, and does what all formats share.
#include <unseen/meshio/mesh_file.h>

#include <unseen/meshio/examine.h>

#include "mesh_writers.h"
#include "text_scanner.h"

namespace unseen::meshio {

namespace fs = std::filesystem;

namespace {

// ---- formats

bool is_ply(std::string_view bytes) { return bytes.starts_with("ply") && bytes.size() > 3 && is_space(bytes[3]); }
bool is_glb(std::string_view bytes) { return bytes.starts_with("glTF"); }

constexpr Format formats[] = {
    // name, endings, signature, reader, writer, values of vertices, materials
    {"PLY", {".ply", ""}, is_ply, read_ply, write_ply, true, false},
    {"OBJ", {".obj", ""}, nullptr, read_obj, write_obj, false, true},
    {"glTF", {".glb", ".gltf"}, is_glb, read_gltf, write_gltf, false, true},
    {"VTP", {".vtp", ""}, is_vtk_xml, read_vtp, write_vtp, true, false},
    {"STL", {".stl", ""}, nullptr, read_stl, write_stl, false, false},
    {"OFF", {".off", ""}, starts_with_off_keyword, read_off, write_off, false, false},
};

constexpr std::string_view utf8_mark = "\xEF\xBB\xBF";

const Format* format_by_signature(std::string_view bytes) {
    for (const Format& format : formats)
        if (format.has_signature != nullptr && format.has_signature(bytes)) return &format;
    return nullptr;
}

// For bytes without a signature in a file without an ending.
const Format* format_by_guess(std::string_view bytes) {
    const std::string_view start = trimmed(bytes.substr(0, std::min<std::size_t>(bytes.size(), 256)));
    if (is_binary_stl(bytes) || start.starts_with("solid") || start.starts_with("SOLID")) return format_named("a.stl");
    if (start.starts_with("{")) return format_named("a.gltf");
    if (start.starts_with("v ") || start.starts_with("mtllib ")) return format_named("a.obj");
    return nullptr;
}

const Format* find_format(std::string_view bytes, const fs::path& name) {
    if (const Format* format = format_by_signature(bytes)) return format;
    if (const Format* format = format_named(name)) return format;
    return format_by_guess(bytes);
}

const char* compression_of(std::string_view bytes) {
    if (bytes.starts_with("\x28\xB5\x2F\xFD")) return "zstd";
    if (bytes.starts_with("\x1F\x8B")) return "gzip";
    if (bytes.starts_with("PK\x03\x04")) return "zip";
    if (bytes.starts_with("\xFD"
                          "7zXZ"))
        return "xz";
    return nullptr;
}

// Normals of vertices in use that are zero (which stands for missing) or not finite are computed from the faces.
void check_normals(ReadResult& result) {
    Mesh& mesh = result.mesh;
    if (mesh.normals.empty()) return;
    for (glm::vec3& normal : mesh.normals)
        if (!is_finite(normal)) normal = missing_normal;
    std::vector<bool> used(mesh.positions.size(), false);
    for (const Triangle& t : mesh.triangles)
        for (const Index v : t) used[v] = true;
    std::uint64_t lost = 0;
    std::size_t first = 0;
    for (std::size_t v = 0; v < used.size(); ++v)
        if (used[v] && mesh.normals[v] == missing_normal && lost++ == 0) first = v;
    if (lost > 0)
        result.warnings.push_back(
            counted_were(lost, "normal") +
            " zero, missing or not finite and computed from the faces, the first that of vertex " +
            std::to_string(first) + ".");
}

// Colours, UVs and what a file says beside them take part in costs and means, where a NaN would spread.
void repair_attributes(ReadResult& result) {
    std::uint64_t colours = 0;
    for (glm::vec4& colour : result.mesh.colours) {
        bool repaired = false;
        for (int i = 0; i < 4; ++i) {
            if (colour[i] >= 0.0f && colour[i] <= 1.0f) continue;
            colour[i] = colour[i] > 1.0f ? 1.0f : 0.0f; // NaN becomes 0
            repaired = true;
        }
        colours += repaired;
    }
    std::vector<bool> has_lost_uvs(result.mesh.positions.size(), false);
    for (std::size_t v = 0; v < result.mesh.uvs.size(); ++v) {
        glm::vec2& uv = result.mesh.uvs[v];
        if (std::isfinite(uv.x) && std::isfinite(uv.y)) continue;
        uv = glm::vec2(0.0f);
        has_lost_uvs[v] = true;
    }
    const auto is_finite = [](float value) { return std::isfinite(value); };
    if (result.document)
        for (auto& channel : result.document->channels)
            for (std::size_t v = 0; v * channel.components < channel.values.size(); ++v) {
                const auto own = std::span(channel.values).subspan(v * channel.components, channel.components);
                if (std::ranges::all_of(own, is_finite)) continue;
                if (channel.name.starts_with("TEXCOORD_")) has_lost_uvs[v] = true;
                for (float& value : own)
                    if (!is_finite(value) || channel.name == "NORMAL") value = 0; // a normal of zeros: none
            }
    if (colours > 0) result.warnings.push_back(counted_were(colours, "vertex colour") + " outside 0..1 and clamped.");
    if (const auto uvs = std::ranges::count(has_lost_uvs, true); uvs > 0)
        result.warnings.push_back(counted_were(static_cast<std::uint64_t>(uvs), "texture coordinate") +
                                  " not finite and set to 0, the first that of vertex " +
                                  std::to_string(std::ranges::find(has_lost_uvs, true) - has_lost_uvs.begin()) + ".");
}

// The runs of those triangles that stay. To be called before the others are dropped.
std::vector<SourceDocument::Run> shortened(const std::vector<SourceDocument::Run>& runs, const Mesh& mesh) {
    std::vector<SourceDocument::Run> kept;
    std::uint64_t dropped = 0;
    for (std::size_t i = 0; i < runs.size(); ++i) {
        const std::uint64_t first = runs[i].first_triangle - dropped;
        const std::uint64_t end = i + 1 < runs.size() ? runs[i + 1].first_triangle : mesh.triangles.size();
        for (std::uint64_t t = runs[i].first_triangle; t < end; ++t) dropped += uses_a_vertex_twice(mesh.triangles[t]);
        if (end - dropped > first) kept.push_back({first, runs[i].part});
    }
    return kept;
}

// "vertex 3 has a NaN or infinite coordinate (the first of 7 such vertices); face 9 uses ...".
std::string described(const BadParts& bad) {
    const auto first_of = [](const std::string& first, std::uint64_t count, const char* such) {
        return first + (count > 1 ? " (the first of " + std::to_string(count) + " such " + such + ")" : "");
    };
    const std::string vertices = first_of(bad.first_vertex, bad.vertices, "vertices");
    if (bad.faces == 0) return vertices;
    return vertices + (bad.vertices > 0 ? "; " : "") + first_of(bad.first_face, bad.faces, "faces");
}

// Faces without a shape are an error unless they are to be left out; bad vertices that no face uses do no harm. Bad
// vertices get a place that does not stretch the mesh.
void settle_bad_parts(const MeshSource& source, ReadResult& result) {
    if (!result.bad.any()) return;
    const std::string text = described(result.bad);
    if (result.bad.left_out == 0) {
        result.warnings.push_back(text + "; no face uses " + (result.bad.vertices == 1 ? "it." : "them."));
    } else {
        if (!source.options.skip_bad)
            throw Fault{text + ". Correct it, or leave out the faces concerned with " +
                        Message::of("{read.skip_bad}.")};
        if (result.mesh.triangles.empty()) fail("no face is left without the bad ones: ", text, ".");
        result.warnings.push_back(counted_were(result.bad.left_out, "face") + " left out: " + text + ".");
    }
    if (result.mesh.triangles.empty()) return;
    const glm::dvec3 place = result.mesh.positions[result.mesh.triangles.front().front()];
    for (glm::dvec3& position : result.mesh.positions)
        if (!is_finite(position)) position = place;
}

// STL files are welded where they are read.
void hint_at_unwelded(const MeshSource& source, ReadResult& result) {
    if (!source.options.weld || !is_unwelded(result.mesh.view())) return;
    result.notes.push_back("every triangle has vertices of its own, at the places of others: it is simplified better "
                           "and takes less memory where they are welded before.");
}

// Trees have none of them. A glTF primitive often uses a few of the vertices that several share.
void tell_of_points(ReadResult& result) {
    if (result.document && result.document->format == SourceDocument::Format::gltf) return;
    std::vector<bool> is_used(result.mesh.positions.size(), false);
    for (const Triangle& t : result.mesh.triangles)
        for (const Index v : t) is_used[v] = true;
    const auto unused = std::ranges::count(is_used, false);
    if (unused > 0)
        result.notes.push_back(std::to_string(unused) + (unused == 1 ? " vertex belongs" : " vertices belong") +
                               " to no face; trees leave " + (unused == 1 ? "it" : "them") + " out.");
}

} // namespace

const Format* format_named(const std::filesystem::path& file) {
    const std::string ending = lower_ending(file);
    for (const Format& format : formats)
        if (!ending.empty() && std::find(format.endings.begin(), format.endings.end(), ending) != format.endings.end())
            return &format;
    return nullptr;
}

std::vector<std::string> written_endings() {
    std::vector<std::string> endings;
    for (const Format& format : formats)
        for (const std::string_view ending : format.endings)
            if (!ending.empty()) endings.emplace_back(ending);
    return endings;
}

ReadResult finish_reading(const MeshSource& source, ReadResult result) {
    settle_bad_parts(source, result);
    if (result.source_vertices == 0) result.source_vertices = result.mesh.positions.size();
    // Before the checks: they would accept a mesh without triangles.
    if (result.mesh.triangles.empty()) fail("it holds no triangles; give a file with faces.");
    if (const Result<void> valid = validate(result.mesh.view()); !valid) throw Fault{valid.error().message};
    repair_attributes(result);
    if (result.document) result.document->runs = shortened(result.document->runs, result.mesh);
    result.dropped_triangles = drop_degenerate_triangles(result.mesh);
    if (result.mesh.triangles.empty())
        fail("all of its ", result.dropped_triangles,
             " triangles use a vertex twice, so none is left; give a file with proper faces.");
    check_normals(result);
    hint_at_unwelded(source, result);
    tell_of_points(result);
    return result;
}

void MeshSource::report(std::uint64_t bytes_done, const char* stage) const {
    const double total = static_cast<double>(std::max<std::size_t>(bytes.size(), 1));
    if (options.progress && !options.progress(std::min(1.0, static_cast<double>(bytes_done) / total), stage))
        throw Fault{"reading was cancelled.", ErrorCode::cancelled};
}

std::string counted_were(std::uint64_t count, const std::string& noun) {
    return std::to_string(count) + " " + noun + (count == 1 ? " was" : "s were");
}

glm::vec4 decode_colour(glm::vec4 encoded, ColourEncoding encoding) {
    if (encoding == ColourEncoding::linear) return encoded;
    return {srgb_to_linear(encoded.r), srgb_to_linear(encoded.g), srgb_to_linear(encoded.b), encoded.a};
}

Result<ReadResult> read_mesh_bytes(std::string_view bytes, const fs::path& name, const ReadOptions& options,
                                   const fs::path& folder) {
    if (bytes.starts_with(utf8_mark)) bytes.remove_prefix(utf8_mark.size());
    const MeshSource source{bytes, name.string(), folder, options};
    return reported<ReadResult>(source, [&] {
        if (bytes.empty()) fail("it is empty; give a file with a mesh in it.");
        if (const char* compression = compression_of(bytes))
            fail("it is compressed with ", compression, "; decompress it first.");
        const Format* const format = find_format(bytes, name);
        if (bytes.starts_with("# vtk DataFile"))
            fail("it is a legacy file of VTK, which is not read; save it as .vtp (in ParaView: Save Data).");
        if (format == nullptr) fail("it is neither PLY, OBJ, OFF, STL, glTF nor VTK's VTP; convert it to one of them.");
        return finish_reading(source, format->read(source));
    });
}

Result<ReadResult> read_mesh(const fs::path& file, const ReadOptions& options) {
    const Result<std::string> bytes = read_regular_file(file);
    if (!bytes) return bytes.error();
    const fs::path folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
    return read_mesh_bytes(*bytes, file, options, folder);
}

} // namespace unseen::meshio
