// Writes meshes as PLY, OBJ and GLB.
#include <meshio/mesh_io.h>

#include <vdtree/internal/atomic_file.h>

#include "mesh_readers.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cctype>
#include <charconv>
#include <cmath>
#include <limits>
#include <map>
#include <vector>

#include <nlohmann/json.hpp>

namespace unseen::meshio {

namespace fs = std::filesystem;
using nlohmann::json;

namespace {

constexpr std::size_t buffer_bytes = std::size_t{1} << 20;

// Collects small pieces for a file; remembers the first failure.
class Output {
public:
    explicit Output(AtomicFile file) : file_(std::move(file)) { buffer_.reserve(buffer_bytes + 256); }

    void text(std::string_view piece) {
        buffer_.append(piece);
        if (buffer_.size() >= buffer_bytes) flush();
    }
    template <class Value>
    void number(Value value) { // in decimal, with the digits that bring back the same value
        std::array<char, 64> digits;
        const auto [end, error] = std::to_chars(digits.data(), digits.data() + digits.size(), value);
        text({digits.data(), end});
    }
    template <class Value>
    void binary(Value value) { // little-endian
        auto raw = std::bit_cast<std::array<char, sizeof(Value)>>(value);
        if constexpr (std::endian::native == std::endian::big) std::reverse(raw.begin(), raw.end());
        text({raw.data(), raw.size()});
    }

    Result<void> finish() {
        flush();
        return status_ ? file_.commit() : status_;
    }

private:
    void flush() {
        if (status_) status_ = file_.write(std::string_view(buffer_));
        buffer_.clear();
    }

    AtomicFile file_;
    std::string buffer_;
    Result<void> status_;
};

bool is_float(double value) { return static_cast<double>(static_cast<float>(value)) == value; }

bool are_floats(const MeshView& mesh) {
    return std::all_of(mesh.positions.begin(), mesh.positions.end(),
                       [](const glm::dvec3& p) { return is_float(p.x) && is_float(p.y) && is_float(p.z); });
}

// ---- PLY ----

std::uint8_t to_byte(float channel) {
    return static_cast<std::uint8_t>(std::lround(std::clamp(channel, 0.0f, 1.0f) * 255.0f));
}

constexpr std::size_t items_a_report = std::size_t{1} << 18; // some milliseconds

Error cancelled() { return {ErrorCode::cancelled, "Writing was cancelled."}; }

void write_ply_header(Output& out, const MeshView& mesh, bool has_floats) {
    const std::string real = has_floats ? "float" : "double";
    // Few programs read unsigned indices, so they are used only where needed.
    const bool needs_unsigned =
        mesh.positions.size() > static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max());
    out.text("ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(mesh.positions.size()) + "\n");
    for (const char* name : {"x", "y", "z"}) out.text("property " + real + " " + name + "\n");
    if (!mesh.normals.empty()) out.text("property float nx\nproperty float ny\nproperty float nz\n");
    if (!mesh.colours.empty()) {
        for (const char* name : {"red", "green", "blue", "alpha"})
            out.text(std::string("property uchar ") + name + "\n");
    }
    if (!mesh.uvs.empty()) out.text("property float s\nproperty float t\n");
    out.text("element face " + std::to_string(mesh.triangles.size()) + "\nproperty list uchar " +
             (needs_unsigned ? "uint" : "int") + " vertex_indices\nend_header\n");
}

Result<void> write_ply(Output& out, const MeshView& mesh, const Progress& progress) {
    const bool has_floats = are_floats(mesh);
    write_ply_header(out, mesh, has_floats);
    const auto vertex_count = static_cast<double>(mesh.positions.size());
    const auto item_count = vertex_count + static_cast<double>(mesh.triangles.size());
    const auto goes_on = [&](double items_done) { return !progress || progress(items_done / item_count, "writing"); };
    for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
        if (i % items_a_report == 0 && !goes_on(static_cast<double>(i))) return cancelled();
        for (int axis = 0; axis < 3; ++axis) {
            if (has_floats) out.binary(static_cast<float>(mesh.positions[i][axis]));
            else out.binary(mesh.positions[i][axis]);
        }
        if (!mesh.normals.empty()) {
            for (int axis = 0; axis < 3; ++axis) out.binary(mesh.normals[i][axis]);
        }
        if (!mesh.colours.empty()) {
            for (int channel = 0; channel < 3; ++channel) {
                out.binary(to_byte(linear_to_srgb(mesh.colours[i][channel])));
            }
            out.binary(to_byte(mesh.colours[i].a));
        }
        if (!mesh.uvs.empty()) {
            out.binary(mesh.uvs[i].x);
            out.binary(mesh.uvs[i].y);
        }
    }
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
        if (i % items_a_report == 0 && !goes_on(vertex_count + static_cast<double>(i))) return cancelled();
        out.binary(std::uint8_t{3});
        for (const Index corner : mesh.triangles[i]) out.binary(corner);
    }
    return {};
}

// ---- OBJ ----

// A name that stands in a line of its own and comes back as it was, but for characters that would end the line.
std::string one_line(const std::string& name) {
    std::string line;
    for (const char c : name) line += std::iscntrl(static_cast<unsigned char>(c)) ? '_' : c;
    if (line.ends_with('\\')) line.back() = '_';
    return line;
}

// What changes in front of a triangle: the names of its group and its material.
struct RangeChange {
    std::uint64_t triangle = 0;
    bool starts = false;
    const MeshRange* range = nullptr;
};

std::vector<RangeChange> range_changes(const MeshView& mesh) {
    std::vector<RangeChange> changes;
    for (const MeshRange& range : mesh.ranges) {
        if (range.triangle_count == 0) continue;
        changes.push_back({range.first_triangle, true, &range});
        changes.push_back({range.first_triangle + range.triangle_count, false, &range});
    }
    // Ends first, so that a range that starts where another ends wins.
    std::stable_sort(changes.begin(), changes.end(), [](const RangeChange& a, const RangeChange& b) {
        return a.triangle != b.triangle ? a.triangle < b.triangle : a.starts < b.starts;
    });
    return changes;
}

void write_obj_corner(Output& out, const MeshView& mesh, Index vertex) {
    const std::uint64_t number = std::uint64_t{vertex} + 1;
    out.text(" ");
    out.number(number);
    if (!mesh.uvs.empty() || !mesh.normals.empty()) out.text("/");
    if (!mesh.uvs.empty()) out.number(number);
    if (mesh.normals.empty()) return;
    out.text("/");
    out.number(number);
}

template <class Vector>
void write_obj_vector(Output& out, const Vector& vector, int size) {
    for (int i = 0; i < size; ++i) {
        out.text(" ");
        out.number(vector[i]);
    }
}

void write_obj_vertices(Output& out, const MeshView& mesh) {
    for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
        out.text("v");
        write_obj_vector(out, mesh.positions[i], 3);
        if (!mesh.colours.empty()) {
            const glm::vec4& c = mesh.colours[i];
            write_obj_vector(out, glm::vec3(linear_to_srgb(c.r), linear_to_srgb(c.g), linear_to_srgb(c.b)), 3);
        }
        out.text("\n");
    }
    for (const glm::vec2& uv : mesh.uvs) {
        out.text("vt");
        write_obj_vector(out, uv, 2);
        out.text("\n");
    }
    for (const glm::vec3& normal : mesh.normals) {
        out.text("vn");
        write_obj_vector(out, normal, 3);
        out.text("\n");
    }
}

void write_obj(Output& out, const MeshView& mesh) {
    write_obj_vertices(out, mesh);
    const std::vector<RangeChange> changes = range_changes(mesh);
    std::size_t next_change = 0;
    for (std::uint64_t i = 0; i < mesh.triangles.size(); ++i) {
        std::map<std::string_view, std::string> names; // by keyword; the last change counts
        for (; next_change < changes.size() && changes[next_change].triangle == i; ++next_change) {
            const RangeChange& change = changes[next_change];
            const bool is_material = change.range->kind == MeshRange::Kind::material;
            names[is_material ? "usemtl" : "g"] = change.starts ? one_line(change.range->name) : std::string();
        }
        for (const auto& [keyword, name] : names) {
            out.text(keyword);
            out.text(" ");
            out.text(name);
            out.text("\n");
        }
        out.text("f");
        for (const Index corner : mesh.triangles[i]) write_obj_corner(out, mesh, corner);
        out.text("\n");
    }
}

// ---- GLB ----

// A run of triangles that becomes a primitive; material -1: none.
struct GlbPrimitive {
    std::uint64_t first = 0;
    std::uint64_t count = 0;
    int material = -1;
};

struct GlbMaterials {
    std::vector<std::string> names;
    std::vector<GlbPrimitive> primitives;
};

GlbMaterials glb_materials(const MeshView& mesh) {
    GlbMaterials result;
    std::map<std::string, int> numbers;
    std::uint64_t done = 0;
    const auto add = [&](std::uint64_t end, int material) {
        if (end > done) result.primitives.push_back({done, end - done, material});
        done = std::max(done, end);
    };
    for (const MeshRange& range : mesh.ranges) {
        const std::uint64_t end = range.first_triangle + range.triangle_count;
        if (range.kind != MeshRange::Kind::material || end <= done) continue;
        const auto [found, is_new] = numbers.try_emplace(range.name, static_cast<int>(result.names.size()));
        if (is_new) result.names.push_back(range.name);
        add(range.first_triangle, -1);
        add(end, found->second);
    }
    add(mesh.triangles.size(), -1);
    return result;
}

// Positions of a GLB are floats; where that loses digits they are taken relative to a centre, and where it leaves the
// range of float, to a size.
struct GlbFrame {
    glm::dvec3 origin{0.0};
    double scale = 1.0;
    bool is_identity = true;

    glm::vec3 to_float(const glm::dvec3& p) const { return glm::vec3((p - origin) / scale); }
};

GlbFrame glb_frame(const MeshView& mesh) {
    GlbFrame frame;
    if (are_floats(mesh)) return frame;
    frame.is_identity = false;
    glm::dvec3 low = mesh.positions[0];
    glm::dvec3 high = low;
    for (const glm::dvec3& p : mesh.positions) {
        for (int axis = 0; axis < 3; ++axis) {
            low[axis] = std::min(low[axis], p[axis]);
            high[axis] = std::max(high[axis], p[axis]);
        }
    }
    frame.origin = low / 2.0 + high / 2.0; // halves first: the sum may overflow
    double extent = 0.0;
    for (int axis = 0; axis < 3; ++axis) extent = std::max(extent, high[axis] / 2.0 - low[axis] / 2.0);
    // Well inside the range of float, and a power of two so that it costs no digits.
    constexpr double largest_plain = 1e30, smallest_plain = 1e-30;
    if (extent > largest_plain || (extent > 0.0 && extent < smallest_plain)) {
        frame.scale = std::ldexp(1.0, std::ilogb(extent));
    }
    return frame;
}

class GlbWriter {
public:
    GlbWriter(Output& out, const MeshView& mesh) : out_(out), mesh_(mesh), frame_(glb_frame(mesh)) {}

    Result<void> write(const fs::path& file) {
        std::string text = document().dump(-1, ' ', false, json::error_handler_t::replace);
        text.resize((text.size() + 3) / 4 * 4, ' ');
        constexpr std::uint64_t headers = 12 + 8 + 8;
        const std::uint64_t total = headers + text.size() + bin_bytes_;
        if (total > std::numeric_limits<std::uint32_t>::max()) {
            return Error{ErrorCode::unsupported,
                         "Cannot write '" + file.string() + "': it would exceed the 4 GiB of a GLB file; write PLY."};
        }
        out_.text("glTF");
        out_.binary(std::uint32_t{2});
        out_.binary(static_cast<std::uint32_t>(total));
        out_.binary(static_cast<std::uint32_t>(text.size()));
        out_.text("JSON");
        out_.text(text);
        out_.binary(static_cast<std::uint32_t>(bin_bytes_));
        out_.text(std::string_view("BIN\0", 4));
        write_data();
        return {};
    }

private:
    json document() {
        json document;
        document["asset"] = {{"version", "2.0"}, {"generator", "Unseen"}};
        document["scene"] = 0;
        document["scenes"] = {{{"nodes", {0}}}};
        json node = {{"mesh", 0}};
        if (!frame_.is_identity) node["translation"] = {frame_.origin.x, frame_.origin.y, frame_.origin.z};
        if (frame_.scale != 1.0) node["scale"] = {frame_.scale, frame_.scale, frame_.scale};
        document["nodes"] = json::array({node});

        add_position_accessor();
        json attributes = {{"POSITION", 0}};
        if (!mesh_.normals.empty()) attributes["NORMAL"] = add_vertex_accessor("VEC3", 3);
        if (!mesh_.colours.empty()) attributes["COLOR_0"] = add_vertex_accessor("VEC4", 4);
        if (!mesh_.uvs.empty()) attributes["TEXCOORD_0"] = add_vertex_accessor("VEC2", 2);
        const GlbMaterials materials = glb_materials(mesh_);
        document["meshes"] = json::array({{{"primitives", primitives(materials, attributes)}}});
        for (const std::string& name : materials.names) document["materials"].push_back({{"name", name}});
        document["accessors"] = std::move(accessors_);
        document["bufferViews"] = std::move(views_);
        document["buffers"] = json::array({{{"byteLength", bin_bytes_}}});
        return document;
    }

    std::size_t add_view(std::uint64_t bytes, int target) {
        views_.push_back({{"buffer", 0}, {"byteOffset", bin_bytes_}, {"byteLength", bytes}, {"target", target}});
        bin_bytes_ += bytes; // all elements have a multiple of four bytes, so everything stays aligned
        return views_.size() - 1;
    }

    std::size_t add_vertex_accessor(const char* type, std::uint64_t components) {
        constexpr int array_buffer = 34962, float_component = 5126;
        const std::size_t view = add_view(mesh_.positions.size() * components * sizeof(float), array_buffer);
        accessors_.push_back({{"bufferView", view},
                              {"componentType", float_component},
                              {"count", mesh_.positions.size()},
                              {"type", type}});
        return accessors_.size() - 1;
    }

    // The only accessor whose bounds glTF wants.
    void add_position_accessor() {
        glm::vec3 low = frame_.to_float(mesh_.positions[0]);
        glm::vec3 high = low;
        for (const glm::dvec3& position : mesh_.positions) {
            const glm::vec3 p = frame_.to_float(position);
            for (int axis = 0; axis < 3; ++axis) {
                low[axis] = std::min(low[axis], p[axis]);
                high[axis] = std::max(high[axis], p[axis]);
            }
        }
        json& accessor = accessors_[add_vertex_accessor("VEC3", 3)];
        accessor["min"] = {low.x, low.y, low.z};
        accessor["max"] = {high.x, high.y, high.z};
    }

    json primitives(const GlbMaterials& materials, const json& attributes) {
        constexpr int element_array_buffer = 34963, unsigned_int_component = 5125, triangles_mode = 4;
        const std::size_t view = add_view(mesh_.triangles.size() * sizeof(Triangle), element_array_buffer);
        json result = json::array();
        for (const GlbPrimitive& primitive : materials.primitives) {
            accessors_.push_back({{"bufferView", view},
                                  {"byteOffset", primitive.first * sizeof(Triangle)},
                                  {"componentType", unsigned_int_component},
                                  {"count", primitive.count * 3},
                                  {"type", "SCALAR"}});
            json entry = {{"attributes", attributes}, {"indices", accessors_.size() - 1}, {"mode", triangles_mode}};
            if (primitive.material >= 0) entry["material"] = primitive.material;
            result.push_back(std::move(entry));
        }
        return result;
    }

    template <class Vector>
    void write_vector(const Vector& vector) {
        for (int i = 0; i < Vector::length(); ++i) out_.binary(vector[i]);
    }

    void write_data() {
        for (const glm::dvec3& position : mesh_.positions) write_vector(frame_.to_float(position));
        for (const glm::vec3& normal : mesh_.normals) write_vector(unit(normal));
        for (const glm::vec4& colour : mesh_.colours) write_vector(colour);
        for (const glm::vec2& uv : mesh_.uvs) write_vector(uv);
        for (const Triangle& triangle : mesh_.triangles) {
            for (const Index corner : triangle) out_.binary(corner);
        }
    }

    // glTF wants unit normals; one that says "compute me" stays zero.
    static glm::vec3 unit(const glm::vec3& normal) {
        const double x = normal.x, y = normal.y, z = normal.z;
        const double length = std::sqrt(x * x + y * y + z * z);
        if (!(length > 0.0) || !std::isfinite(length)) return missing_normal;
        return {static_cast<float>(x / length), static_cast<float>(y / length), static_cast<float>(z / length)};
    }

    Output& out_;
    const MeshView& mesh_;
    GlbFrame frame_;
    json views_ = json::array();
    json accessors_ = json::array();
    std::uint64_t bin_bytes_ = 0;
};

Error cannot_write(const fs::path& file, const std::string& why) {
    return {ErrorCode::invalid_argument, "Cannot write '" + file.string() + "': " + why};
}

} // namespace

Result<void> write_mesh(const fs::path& file, const MeshView& mesh, const Progress& progress) {
    std::string ending = file.extension().string();
    for (char& c : ending) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    if (ending != ".ply" && ending != ".obj" && ending != ".glb") {
        return cannot_write(file, "its name does not end in .ply, .obj or .glb; choose one of these.");
    }
    if (const Result<void> valid = validate(mesh); !valid) return cannot_write(file, valid.error().message);
    if (ending == ".glb" && mesh.triangles.empty()) {
        return cannot_write(file, "the mesh has no triangles, and GLB cannot hold such a mesh; write PLY.");
    }
    Result<AtomicFile> target = AtomicFile::create(file);
    if (!target) return target.error();
    Output out(std::move(*target));
    if (ending == ".ply") {
        if (const Result<void> written = write_ply(out, mesh, progress); !written) return written;
    } else if (ending == ".obj") {
        write_obj(out, mesh);
    } else if (const Result<void> written = GlbWriter(out, mesh).write(file); !written) {
        return written;
    }
    return out.finish();
}

} // namespace unseen::meshio
