// Writes meshes as PLY, OBJ, glTF, STL and OFF.
#include "mesh_writers.h"

#include "gltf_writer.h"
#include "kept_arrays.h"
#include "obj_lines.h"
#include "ply_slots.h"
#include "value_types.h"

#include <map>
#include <numeric>
#include <set>

#include <glm/common.hpp>

namespace unseen::meshio {

namespace fs = std::filesystem;
using nlohmann::json;

namespace {

bool is_float(double value) { return static_cast<double>(static_cast<float>(value)) == value; }

// ---- PLY ----

Error cancelled() { return {ErrorCode::cancelled, "Writing was cancelled."}; }

// One component of an array, as a property of PLY.
struct PlyColumn {
    std::string name;
    ValueType type = ValueType::float32; // one of PLY's
    const VertexArray* array = nullptr;
    std::uint32_t component = 0;
};

// PLY has no integers of 64 bits.
ValueType ply_type(const VertexArray& array, std::uint32_t component) {
    if (array.type != ValueType::int64 && array.type != ValueType::uint64) return array.type;
    const ValueRange range = range_of(array, component);
    const auto fits = [&](double low, double high) { return range.low >= low && range.high <= high; };
    if (fits(INT32_MIN, INT32_MAX)) return ValueType::int32;
    return fits(0, UINT32_MAX) ? ValueType::uint32 : ValueType::float64;
}

class PlyColumns {
public:
    PlyColumns(const MeshView& mesh, std::span<const VertexArray> arrays, std::vector<Message>& notes) {
        std::vector<std::string> parted, rounded;
        for (const VertexArray& array : arrays) {
            if (array.role != VertexArray::Role::value) continue;
            if (array.components > 1) parted.push_back(array.name);
            for (std::uint32_t c = 0; c < array.components; ++c) {
                const std::string name = array.components > 1 ? array.name + "_" + std::to_string(c) : array.name;
                columns_.push_back({one_word(name), ply_type(array, c), &array, c});
                if (columns_.back().type == ValueType::float64 && is_integer(array.type)) rounded.push_back(name);
            }
        }
        rename(mesh, notes);
        if (!parted.empty())
            notes.push_back("PLY has single values: each component of " + listed(parted) +
                            " is a property, with _0, _1 and so on behind its name.");
        if (!rounded.empty())
            notes.push_back("PLY has no integers of 64 bits: " + listed(rounded) +
                            " became double, which is exact up to 2^53.");
    }

    void write_header(FileOutput& out) const {
        for (const PlyColumn& column : columns_)
            out.text(text_of("property ", ply::classic_name(column.type), " ", column.name, "\n"));
    }
    void write_row(FileOutput& out, std::size_t vertex) const {
        for (const PlyColumn& column : columns_) {
            const std::byte* const from = column.array->values.data() + vertex * column.array->tuple_bytes() +
                                          column.component * byte_size(column.array->type);
            with_type(column.array->type, [&](auto tag) {
                const auto value = load_value<typename decltype(tag)::type>(from);
                if (column.type == column.array->type) return out.binary(value);
                with_type(column.type, [&](auto to) { out.binary(static_cast<typename decltype(to)::type>(value)); });
            });
        }
    }

private:
    static std::string one_word(std::string name) {
        for (char& c : name)
            if (!std::isgraph(static_cast<unsigned char>(c)) && static_cast<unsigned char>(c) < 0x80) c = '_';
        return name.empty() ? "_" : name;
    }

    // Those that would be read as positions, normals, colours or texture coordinates, and those of one name.
    void rename(const MeshView& mesh, std::vector<Message>& notes) {
        using namespace ply;
        std::array<bool, slot_count> present{};
        for (const PlyColumn& column : columns_) present[slot_of(column.name)] = true;
        const auto mean = [&](bool has, std::initializer_list<Slot> group, std::initializer_list<Slot> more = {}) {
            const bool is_meant =
                has || std::all_of(group.begin(), group.end(), [&](Slot slot) { return present[slot]; });
            for (const Slot slot : group) present[slot] = is_meant;
            for (const Slot slot : more) present[slot] = is_meant;
        };
        mean(true, {x, y, z});
        mean(!mesh.normals.empty(), {nx, ny, nz});
        mean(!mesh.colours.empty(), {red, green, blue}, {alpha});
        mean(!mesh.uvs.empty(), {u, v});
        std::set<std::string> used;
        std::vector<std::string> renamed;
        for (PlyColumn& column : columns_) {
            const std::string before = column.name;
            const auto is_taken = [&] {
                const Slot slot = slot_of(column.name);
                return (slot != ignored && present[slot]) || used.contains(column.name);
            };
            while (is_taken()) column.name += '_';
            used.insert(column.name);
            if (column.name != before) renamed.push_back(before);
        }
        if (!renamed.empty())
            notes.push_back("in PLY these names are taken, and got a _ behind them: " + listed(renamed) + ".");
    }

    std::vector<PlyColumn> columns_;
};

void write_ply_header(FileOutput& out, const MeshView& mesh, const PlyColumns& columns, bool has_floats) {
    // Few programs read unsigned indices, so they are used only where needed.
    const bool needs_unsigned =
        mesh.positions.size() > static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max());
    const auto properties = [&](const char* type, std::initializer_list<const char*> names) {
        for (const char* name : names) out.text(text_of("property ", type, " ", name, "\n"));
    };
    out.text(text_of("ply\nformat binary_little_endian 1.0\nelement vertex ", mesh.positions.size(), "\n"));
    properties(has_floats ? "float" : "double", {"x", "y", "z"});
    if (!mesh.normals.empty()) properties("float", {"nx", "ny", "nz"});
    if (!mesh.colours.empty()) properties("uchar", {"red", "green", "blue", "alpha"});
    if (!mesh.uvs.empty()) properties("float", {"s", "t"});
    columns.write_header(out);
    out.text(text_of("element face ", mesh.triangles.size(), "\nproperty list uchar ", needs_unsigned ? "uint" : "int",
                     " vertex_indices\nend_header\n"));
}

Result<void> write_ply_to(FileOutput& out, const MeshView& mesh, const PlyColumns& columns, const Progress& progress) {
    constexpr std::size_t items_a_report = std::size_t{1} << 18; // some milliseconds
    const bool has_floats = are_floats(mesh);
    write_ply_header(out, mesh, columns, has_floats);
    const auto vertex_count = static_cast<double>(mesh.positions.size());
    const auto item_count = vertex_count + static_cast<double>(mesh.triangles.size());
    const auto goes_on = [&](double items_done) { return !progress || progress(items_done / item_count, "writing"); };
    for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
        if (i % items_a_report == 0 && !goes_on(static_cast<double>(i))) return cancelled();
        if (has_floats) out.binary(glm::vec3(mesh.positions[i]));
        else out.binary(mesh.positions[i]);
        if (!mesh.normals.empty()) out.binary(mesh.normals[i]);
        if (!mesh.colours.empty()) out.binary(encoded_bytes(mesh.colours[i]));
        if (!mesh.uvs.empty()) out.binary(mesh.uvs[i]);
        columns.write_row(out, i);
    }
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
        if (i % items_a_report == 0 && !goes_on(vertex_count + static_cast<double>(i))) return cancelled();
        out.binary(std::uint8_t{3});
        out.binary(mesh.triangles[i]);
    }
    return {};
}

// ---- OBJ ----

void write_obj_to(FileOutput& out, const MeshView& mesh, std::span<const Index> places) {
    std::vector<Index> own;
    if (places.empty()) {
        own.resize(mesh.positions.size());
        std::iota(own.begin(), own.end(), Index{0});
        places = own;
    }
    const ObjLines positions(places, mesh.colours), uvs(mesh.uvs), normals(mesh.normals);
    positions.for_each([&](std::size_t i) {
        out.text("v");
        out.numbers(mesh.positions[i], 3);
        if (!mesh.colours.empty()) out.numbers(encoded(mesh.colours[i]), 3);
        out.text("\n");
    });
    uvs.write(out, "vt", mesh.uvs, 2);
    normals.write(out, "vn", mesh.normals, 3);
    // By triangle and keyword: the name that holds from there on. A range that starts where another ends wins.
    std::map<std::uint64_t, std::map<std::string_view, std::string>> names;
    for (const MeshRange& range : mesh.ranges) {
        if (range.triangle_count == 0) continue;
        const char* const keyword = range.kind == MeshRange::Kind::material ? "usemtl" : "g";
        names[range.first_triangle][keyword] = one_line(range.name);
        names[range.first_triangle + range.triangle_count].try_emplace(keyword);
    }
    auto next = names.begin();
    for (std::uint64_t i = 0; i < mesh.triangles.size(); ++i) {
        if (next != names.end() && next->first == i)
            for (const auto& [keyword, name] : next++->second) out.text(text_of(keyword, " ", name, "\n"));
        out.text("f");
        for (const Index corner : mesh.triangles[i])
            write_obj_corner(out, positions.number(corner), uvs.empty() ? 0 : uvs.number(corner),
                             normals.empty() ? 0 : normals.number(corner));
        out.text("\n");
    }
}

// ---- glTF ----

// A run of triangles that becomes a primitive; material -1: none.
struct GltfPrimitive {
    std::uint64_t first = 0;
    std::uint64_t count = 0;
    int material = -1;
};

std::vector<GltfPrimitive> gltf_primitives(const MeshView& mesh, std::vector<std::string>& materials) {
    std::vector<GltfPrimitive> primitives;
    std::map<std::string, int> numbers;
    std::uint64_t done = 0;
    const auto add = [&](std::uint64_t end, int material) {
        if (end > done) primitives.push_back({done, end - done, material});
        done = std::max(done, end);
    };
    for (const MeshRange& range : mesh.ranges) {
        const std::uint64_t end = range.first_triangle + range.triangle_count;
        if (range.kind != MeshRange::Kind::material || end <= done) continue;
        const auto [found, is_new] = numbers.try_emplace(range.name, static_cast<int>(materials.size()));
        if (is_new) materials.push_back(range.name);
        add(range.first_triangle, -1);
        add(end, found->second);
    }
    add(mesh.triangles.size(), -1);
    return primitives;
}

// glTF wants unit normals; one that says "compute me" stays zero.
glm::vec3 unit(const glm::vec3& normal) {
    const double length = glm::length(glm::dvec3(normal));
    return length > 0 && std::isfinite(length) ? glm::vec3(glm::dvec3(normal) / length) : missing_normal;
}

Error cannot_write(const fs::path& file, const std::string& why) {
    return {ErrorCode::invalid_argument, "Cannot write '" + file.string() + "': " + why};
}

} // namespace

std::string lower_ending(const fs::path& file) {
    std::string ending = file.extension().string();
    for (char& c : ending) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    return ending;
}

bool are_floats(const MeshView& mesh) {
    return std::all_of(mesh.positions.begin(), mesh.positions.end(),
                       [](const glm::dvec3& p) { return is_float(p.x) && is_float(p.y) && is_float(p.z); });
}

std::uint8_t to_byte(float channel) {
    return static_cast<std::uint8_t>(std::lround(std::clamp(channel, 0.0f, 1.0f) * 255.0f));
}

glm::vec4 encoded(const glm::vec4& c) { return {linear_to_srgb(c.r), linear_to_srgb(c.g), linear_to_srgb(c.b), c.a}; }

std::array<std::uint8_t, 4> encoded_bytes(const glm::vec4& colour) {
    const glm::vec4 c = encoded(colour);
    return {to_byte(c.r), to_byte(c.g), to_byte(c.b), to_byte(c.a)};
}

Result<void> write_ply(const MeshToWrite& to) {
    const PlyColumns columns(to.mesh, to.arrays, to.notes);
    return write_file(to.file, [&](FileOutput& out) { return write_ply_to(out, to.mesh, columns, to.progress); });
}

Result<void> write_obj(const MeshToWrite& to) {
    return write_file(to.file, [&](FileOutput& out) { write_obj_to(out, to.mesh, to.places); });
}

Result<void> write_gltf(const MeshToWrite& to) {
    const MeshView& mesh = to.mesh;
    if (mesh.triangles.empty())
        return cannot_write(to.file, "the mesh has no triangles, and glTF cannot hold such a mesh; write PLY.");
    // Positions of glTF are floats; where that loses digits they are taken relative to a centre, and where it leaves the
    // range of float, to a size: a power of two, so that it costs no digits.
    json node = {{"mesh", 0}};
    glm::dvec3 origin(0);
    double scale = 1;
    if (!are_floats(mesh)) {
        glm::dvec3 low = mesh.positions[0], high = low;
        for (const glm::dvec3& p : mesh.positions) low = glm::min(low, p), high = glm::max(high, p);
        origin = low / 2.0 + high / 2.0; // halves first: the sum may overflow
        const glm::dvec3 half = high / 2.0 - low / 2.0;
        const double extent = std::max({half.x, half.y, half.z});
        constexpr double largest_plain = 1e30, smallest_plain = 1e-30; // well inside the range of float
        if (extent > largest_plain || (extent > 0 && extent < smallest_plain))
            scale = std::ldexp(1.0, std::ilogb(extent));
        node["translation"] = {origin.x, origin.y, origin.z};
        if (scale != 1) node["scale"] = {scale, scale, scale};
    }
    std::vector<glm::vec3> positions, normals;
    positions.reserve(mesh.positions.size());
    for (const glm::dvec3& p : mesh.positions) positions.emplace_back((p - origin) / scale);
    normals.reserve(mesh.normals.size());
    for (const glm::vec3& n : mesh.normals) normals.push_back(unit(n));

    GltfFile out;
    json attributes = {{"POSITION", out.add_positions(positions)}};
    if (!normals.empty()) attributes["NORMAL"] = out.add_attribute("NORMAL", floats_of(normals), 3);
    if (!mesh.colours.empty()) attributes["COLOR_0"] = out.add_attribute("COLOR_0", floats_of(mesh.colours), 4);
    if (!mesh.uvs.empty()) attributes["TEXCOORD_0"] = out.add_attribute("TEXCOORD_0", floats_of(mesh.uvs), 2);
    std::vector<std::string> materials;
    const std::size_t view = out.add_indices(mesh.triangles);
    json primitives = json::array();
    for (const GltfPrimitive& primitive : gltf_primitives(mesh, materials)) {
        json entry = out.primitive(attributes, view, primitive.first, primitive.count);
        if (primitive.material >= 0) entry["material"] = primitive.material;
        primitives.push_back(std::move(entry));
    }
    json document = {{"scene", 0},
                     {"scenes", {{{"nodes", {0}}}}},
                     {"nodes", json::array({node})},
                     {"meshes", json::array({{{"primitives", primitives}}})}};
    for (const std::string& name : materials) document["materials"].push_back({{"name", name}});
    return out.write(to.file, std::move(document));
}

// Facets with their own normals.
Result<void> write_stl(const MeshToWrite& to) {
    const MeshView& mesh = to.mesh;
    if (mesh.triangles.size() > std::numeric_limits<std::uint32_t>::max())
        return cannot_write(to.file, "STL counts triangles in 32 bits; write PLY.");
    for (const glm::dvec3& p : mesh.positions)
        if (!is_finite(glm::vec3(p)))
            return cannot_write(to.file, "STL has floats, which do not reach to its vertices; write PLY.");
    if (!are_floats(mesh)) to.notes.push_back("STL has floats: the vertices were rounded to them.");
    if (!mesh.colours.empty() || !mesh.uvs.empty() || !mesh.normals.empty())
        to.notes.push_back(
            "STL has triangles alone: normals, colours and texture coordinates of vertices were left out.");
    return write_file(to.file, [&](FileOutput& out) {
        out.text(std::string("written by unseen") + std::string(63, ' '));
        out.binary(static_cast<std::uint32_t>(mesh.triangles.size()));
        for (const Triangle& t : mesh.triangles) {
            const glm::dvec3 a = mesh.positions[t[0]], b = mesh.positions[t[1]], c = mesh.positions[t[2]];
            const glm::vec3 normal = unit(glm::vec3(glm::normalize(glm::cross(b - a, c - a))));
            out.binary(normal);
            for (const glm::dvec3& corner : {a, b, c}) out.binary(glm::vec3(corner));
            out.binary(std::uint16_t{0});
        }
    });
}

Result<void> write_off(const MeshToWrite& to) {
    const MeshView& mesh = to.mesh;
    return write_file(to.file, [&](FileOutput& out) {
        const std::string keyword = std::string(mesh.uvs.empty() ? "" : "ST") + (mesh.colours.empty() ? "" : "C") +
                                    (mesh.normals.empty() ? "" : "N") + "OFF\n";
        out.text(keyword + std::to_string(mesh.positions.size()) + " " + std::to_string(mesh.triangles.size()) + " 0");
        for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
            out.text("\n");
            out.numbers(mesh.positions[v], 3);
            if (!mesh.normals.empty()) out.numbers(mesh.normals[v], 3);
            if (!mesh.colours.empty()) out.numbers(encoded(mesh.colours[v]), 4);
            if (!mesh.uvs.empty()) out.numbers(mesh.uvs[v], 2);
        }
        for (const Triangle& triangle : mesh.triangles) {
            out.text("\n3");
            for (const Index corner : triangle) out.text(text_of(" ", corner));
        }
        out.text("\n");
    });
}

Result<void> write_mesh_with(const fs::path& file, const MeshView& mesh, std::span<const VertexArray> arrays,
                             std::vector<Message>& notes, const Progress& progress, std::span<const Index> places) {
    const Format* format = format_named(file);
    if (format == nullptr) {
        std::string endings;
        for (const std::string& ending : written_endings()) endings += (endings.empty() ? "" : ", ") + ending;
        return cannot_write(file, "its name ends in none of " + endings + "; choose one of these.");
    }
    if (const Result<void> valid = validate(mesh); !valid) return cannot_write(file, valid.error().message);
    if (const auto names = names_of(arrays); !names.empty() && !format->holds_values)
        notes.push_back("values of vertices were left out: " + listed(names) + "; .ply and .vtp hold them.");
    return format->write({file, mesh, arrays, notes, progress, places});
}

Result<void> write_mesh(const fs::path& file, const MeshView& mesh, const Progress& progress) {
    std::vector<Message> no_notes; // without arrays there is nothing to tell
    return write_mesh_with(file, mesh, {}, no_notes, progress);
}

} // namespace unseen::meshio
