// Values of vertices: read from PLY, kept with a tree, restored in cuts, written again.
#include <unseen/meshio/mesh_file.h>

#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/tree_io.h>

#include "kept_arrays.h"
#include "mesh_files.h"
#include "mesh_readers.h"
#include "mesh_writers.h"
#include "read_bytes.h"
#include "shapes.h"
#include "temp_folder.h"
#include "value_types.h"

namespace unseen::vdtree::vertex_values_test {

using namespace std::string_literals;
using meshio::SourceDocument;
using meshio::ValueType;
using meshio::VertexArray;
using support::read;

constexpr double infinity = std::numeric_limits<double>::infinity(), nan = std::numeric_limits<double>::quiet_NaN();

template <class T>
VertexArray array_of(const std::string& name, ValueType type, std::uint32_t components, const std::vector<T>& values) {
    VertexArray array{.name = name, .type = type, .components = components};
    for (const T value : values) meshio::append_value(array.values, value);
    return array;
}

template <class T>
std::vector<T> values_of(const VertexArray& array) {
    std::vector<T> values(array.values.size() / sizeof(T));
    std::memcpy(values.data(), array.values.data(), values.size() * sizeof(T));
    return values;
}

const VertexArray& named(const std::vector<VertexArray>& arrays, const std::string& name) {
    for (const VertexArray& array : arrays)
        if (array.name == name) return array;
    throw std::runtime_error("there is no array " + name);
}

VertexTree tree_with(Mesh mesh, std::vector<VertexArray> arrays) {
    const SourceDocument document{.format = SourceDocument::Format::table, .arrays = std::move(arrays)};
    mesh.further = meshio::further_values(document);
    if (mesh.further.size() != mesh.positions.size()) mesh.further.clear();
    mesh.document = meshio::pack(document);
    return std::move(*require(build_tree(mesh.view())));
}

glm::dvec3 face_normal(const Mesh& mesh, const Triangle& t) {
    const glm::dvec3 a = mesh.positions[t[0]];
    return glm::normalize(glm::cross(mesh.positions[t[1]] - a, mesh.positions[t[2]] - a));
}

// A cube whose sides have vertices of their own, and what each vertex's side is called.
struct SidedCube {
    Mesh mesh;
    std::vector<double> sides;

    explicit SidedCube(int n) {
        const Mesh cube = shapes::cube(n);
        std::map<std::pair<Index, double>, Index> numbers;
        for (Triangle t : cube.triangles) {
            const double side = glm::dot(face_normal(cube, t), glm::dvec3(1, 2, 4));
            for (Index& v : t) {
                const auto [entry, is_new] = numbers.try_emplace({v, side}, static_cast<Index>(sides.size()));
                if (is_new) mesh.positions.push_back(cube.positions[v]), sides.push_back(side);
                v = entry->second;
            }
            mesh.triangles.push_back(t);
        }
        mesh.normals.assign(mesh.positions.size(), glm::vec3(0, 0, 1)); // so that nothing but values sets sides apart
    }
};

Cut full_cut(const VertexTree& tree) {
    Cut cut(tree);
    cut.unfold_all();
    return cut;
}

// A cut somewhere in between: by some nodes or others.
Cut part_cut(const VertexTree& tree, unsigned seed) {
    std::mt19937 random(seed);
    Cut cut(tree);
    for (int i = 0; i < 40; ++i) cut.unfold_ancestors(static_cast<NodeId>(random() % tree.node_count()));
    return cut;
}

const std::string ply_types[] = {"char", "uchar", "short", "ushort", "int", "uint", "float", "double"};

std::string ply_head(const std::string& format) {
    std::string head = "ply\nformat " + format +
                       " 1.0\nelement vertex 3\nproperty float x\nproperty int8 before\n"
                       "property float y\nproperty float z\n";
    for (const std::string& type : ply_types) head += "property " + type + " a_" + type + "\n";
    return head + "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
}

void expect_ply_arrays(const meshio::ReadResult& result) {
    ASSERT_TRUE(result.document);
    EXPECT_EQ(result.document->format, SourceDocument::Format::table);
    const auto& arrays = result.document->arrays;
    ASSERT_EQ(arrays.size(), 9u);
    EXPECT_EQ(values_of<std::int8_t>(named(arrays, "before")), (std::vector<std::int8_t>{-1, 0, 1}));
    EXPECT_EQ(values_of<std::int8_t>(named(arrays, "a_char")), (std::vector<std::int8_t>{-128, 127, 0}));
    EXPECT_EQ(values_of<std::uint8_t>(named(arrays, "a_uchar")), (std::vector<std::uint8_t>{0, 255, 1}));
    EXPECT_EQ(values_of<std::int16_t>(named(arrays, "a_short")), (std::vector<std::int16_t>{-32768, 32767, 1}));
    EXPECT_EQ(values_of<std::uint16_t>(named(arrays, "a_ushort")), (std::vector<std::uint16_t>{0, 65535, 1}));
    EXPECT_EQ(values_of<std::int32_t>(named(arrays, "a_int")), (std::vector<std::int32_t>{INT32_MIN, INT32_MAX, 1}));
    EXPECT_EQ(values_of<std::uint32_t>(named(arrays, "a_uint")), (std::vector<std::uint32_t>{0, UINT32_MAX, 1}));
    EXPECT_EQ(values_of<float>(named(arrays, "a_float"))[0], 0.1f);
    EXPECT_EQ(values_of<float>(named(arrays, "a_float"))[1], std::numeric_limits<float>::max());
    EXPECT_TRUE(std::isnan(values_of<float>(named(arrays, "a_float"))[2]));
    EXPECT_EQ(values_of<double>(named(arrays, "a_double")), (std::vector<double>{0.1, -infinity, 1e-320}));
}

TEST(PlyValues, OfEveryTypeAreReadAsTheyAre) {
    expect_ply_arrays(read(ply_head("ascii") + "0 -1 0 0 -128 0 -32768 0 -2147483648 0 0.1 0.1\n"
                                               "1 0 0 0 127 255 32767 65535 2147483647 4294967295 3.40282347e38 -inf\n"
                                               "0 1 1 0 0 1 1 1 1 1 nan 1e-320\n3 0 1 2\n",
                           "a.ply"));
    for (const std::endian order : {std::endian::little, std::endian::big}) {
        const auto b = [&](auto value) { return mesh_files::bytes(value, order); };
        const auto row = [&](float x, std::int8_t before, float y, std::int8_t c, std::uint8_t uc, std::int16_t s,
                             std::uint16_t us, std::int32_t i, std::uint32_t ui, float f, double d) {
            return b(x) + b(before) + b(y) + b(0.0f) + b(c) + b(uc) + b(s) + b(us) + b(i) + b(ui) + b(f) + b(d);
        };
        expect_ply_arrays(read(ply_head(order == std::endian::little ? "binary_little_endian" : "binary_big_endian") +
                                   row(0, -1, 0, -128, 0, -32768, 0, INT32_MIN, 0, 0.1f, 0.1) +
                                   row(1, 0, 0, 127, 255, 32767, 65535, INT32_MAX, UINT32_MAX,
                                       std::numeric_limits<float>::max(), -infinity) +
                                   row(0, 1, 1, 0, 1, 1, 1, 1, 1, std::numeric_limits<float>::quiet_NaN(), 1e-320) +
                                   "\3" + b(std::int32_t{0}) + b(std::int32_t{1}) + b(std::int32_t{2}),
                               "a.ply"));
    }
}

std::string ply_with(const std::string& properties, const std::string& values, const std::string& of_faces = "") {
    return "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n" +
           properties + "element face 1\nproperty list uchar int vertex_indices\n" + of_faces + "end_header\n0 0 0 " +
           values + "\n1 0 0 " + values + "\n0 1 0 " + values + "\n3 0 1 2" + (of_faces.empty() ? "" : " 1 2 5 6") +
           "\n";
}

TEST(PlyValues, OfLoneComponentsAreNoAttributes) {
    meshio::ReadResult result = read(
        ply_with("property float nx\nproperty float ny\nproperty uchar red\nproperty uchar alpha\nproperty float t\n",
                 "1 2 3 4 5"),
        "a.ply");
    EXPECT_TRUE(result.mesh.normals.empty() && result.mesh.colours.empty() && result.mesh.uvs.empty());
    EXPECT_THAT(meshio::names_of(result.document->arrays), ElementsAre("nx", "ny", "red", "alpha", "t"));
    result =
        read(ply_with("property float u\nproperty float v\nproperty float w\nproperty float s\n", "1 2 3 4"), "a.ply");
    EXPECT_EQ(result.mesh.uvs[0], glm::vec2(1, 2));
    EXPECT_THAT(meshio::names_of(result.document->arrays), ElementsAre("w", "s"));
    EXPECT_FALSE(read(mesh_files::ascii_ply_quad(), "a.ply").document) << "nothing to keep";
}

TEST(PlyValues, WhatIsLeftOutIsSaid) {
    const meshio::ReadResult result =
        read(ply_with("property uchar q\nproperty list uchar int tags\nproperty uchar q\nproperty int half\n",
                      "1 2 8 9 1 0.5", "property uchar flag\nproperty list uchar int more\n"),
             "a.ply");
    EXPECT_THAT(meshio::names_of(result.document->arrays), ElementsAre("q"));
    EXPECT_THAT(result.warnings, ElementsAre("the property 'half' was left out: that of vertex 0 is no int32, as the "
                                             "header says."));
    EXPECT_THAT(result.notes, ElementsAre(HasSubstr("lists of vertices were left out: 'tags'"),
                                          HasSubstr("of one name the first was kept: 'q'"),
                                          HasSubstr("values of faces were left out: 'flag' and 'more'")));
}

std::vector<std::string> ply_properties(const std::filesystem::path& file) {
    std::vector<std::string> lines;
    const std::string bytes = support::read_bytes(file);
    for (std::size_t at = bytes.find("property"); at < bytes.find("element face"); at = bytes.find("property", at + 1))
        lines.push_back(bytes.substr(at + 9, bytes.find('\n', at) - at - 9));
    return lines;
}

TEST(PlyValues, ArraysBecomeProperties) {
    const support::TempFolder folder;
    Mesh mesh = shapes::single_triangle();
    mesh.normals = {}, mesh.colours = {}, mesh.uvs = {};
    std::vector<Message> notes;
    const std::vector<VertexArray> arrays = {
        array_of<float>("wind speed", ValueType::float32, 2, {1, 2, 3, 4, 5, 6}),
        array_of<std::int64_t>("small", ValueType::int64, 1, {-5, 0, 5}),
        array_of<std::int64_t>("middle", ValueType::int64, 1, {0, 1, UINT32_MAX}),
        array_of<std::uint64_t>("large", ValueType::uint64, 1, {1, 2, std::uint64_t{1} << 52}),
        array_of<float>("u", ValueType::float32, 1, {1, 2, 3}),
        array_of<float>("x", ValueType::float32, 1, {1, 2, 3}),
        array_of<float>("wind_speed_0", ValueType::float32, 1, {7, 8, 9})};
    ASSERT_TRUE(meshio::write_mesh_with(folder / "a.ply", mesh.view(), arrays, notes));
    EXPECT_THAT(ply_properties(folder / "a.ply"),
                ElementsAre("float x", "float y", "float z", "float wind_speed_0", "float wind_speed_1", "int small",
                            "uint middle", "double large", "float u", "float x_", "float wind_speed_0_"));
    EXPECT_THAT(notes, ElementsAre(HasSubstr("got a _ behind them: 'x' and 'wind_speed_0'"), HasSubstr("'wind speed'"),
                                   HasSubstr("no integers of 64 bits: 'large' became double")));
    const auto again = require(meshio::read_mesh(folder / "a.ply"));
    const auto& found = again->document->arrays;
    EXPECT_EQ(values_of<float>(named(found, "wind_speed_1")), (std::vector<float>{2, 4, 6}));
    EXPECT_EQ(values_of<std::int32_t>(named(found, "small")), (std::vector<std::int32_t>{-5, 0, 5}));
    EXPECT_EQ(values_of<double>(named(found, "large"))[2], std::ldexp(1.0, 52));
    EXPECT_EQ(values_of<float>(named(found, "u")), (std::vector<float>{1, 2, 3}));
    // A pair would be read as texture coordinates.
    const std::vector<VertexArray> pair = {arrays[4], array_of<float>("t", ValueType::float32, 1, {4, 5, 6})};
    ASSERT_TRUE(meshio::write_mesh_with(folder / "b.ply", mesh.view(), pair, notes));
    EXPECT_THAT(ply_properties(folder / "b.ply"), ElementsAre("float x", "float y", "float z", "float u_", "float t_"));
}

std::vector<VertexArray> some_arrays(std::size_t vertices) {
    std::mt19937 random(7);
    std::vector<double> reals(vertices);
    std::vector<float> vectors(3 * vertices);
    std::vector<std::int64_t> labels(vertices);
    for (double& value : reals) value = std::uniform_real_distribution(-1.0, 1.0)(random);
    for (float& value : vectors) value = std::uniform_real_distribution(-1.0f, 1.0f)(random);
    for (std::int64_t& value : labels) value = static_cast<std::int64_t>(random()) << 24 | 1;
    for (std::size_t v = 0; v < vertices; v += 5) reals[v] = v % 2 ? nan : infinity;
    return {array_of("real", ValueType::float64, 1, reals), array_of("vector", ValueType::float32, 3, vectors),
            array_of("label", ValueType::int64, 1, labels)};
}

TEST(VertexValues, ComeBackFromBytes) {
    SourceDocument document{.format = SourceDocument::Format::table, .arrays = some_arrays(20)};
    document.arrays.push_back({.name = "n", .components = 3, .role = VertexArray::Role::normals});
    const auto bytes = meshio::pack(document);
    const auto again = require(meshio::unpack(bytes));
    EXPECT_EQ(again->format, SourceDocument::Format::table);
    ASSERT_EQ(again->arrays.size(), 4u);
    for (std::size_t i = 0; i < 4; ++i) {
        EXPECT_EQ(again->arrays[i].name, document.arrays[i].name);
        EXPECT_EQ(again->arrays[i].type, document.arrays[i].type);
        EXPECT_EQ(again->arrays[i].components, document.arrays[i].components);
        EXPECT_EQ(again->arrays[i].role, document.arrays[i].role);
        EXPECT_EQ(again->arrays[i].values, document.arrays[i].values);
    }
    EXPECT_EQ(meshio::pack(*again), bytes);
}

// The bytes that glTF and OBJ documents had before there were arrays.
TEST(VertexValues, LeaveOlderDocumentsAsTheyWere) {
    const auto bytes = meshio::pack({.format = SourceDocument::Format::obj,
                                     .parts = {{}},
                                     .runs = {{0, 0}},
                                     .vertex_parts = std::vector<std::uint32_t>(3, 0)});
    EXPECT_EQ(std::memcmp(bytes.data(), "UNSEENSD\1\0\0\0\2\0\0\0", 16), 0);
    ASSERT_TRUE(meshio::unpack(bytes));
    const auto table = meshio::pack({.format = SourceDocument::Format::table, .arrays = some_arrays(4)});
    EXPECT_EQ(std::memcmp(table.data(), "UNSEENSD\2\0\0\0\3\0\0\0", 16), 0) << "older programs refuse the version";
}

TEST(VertexValues, OfDamagedBytesLeadNobodyAstray) {
    const support::TempFolder folder;
    const Mesh mesh = shapes::icosphere(1);
    const auto good =
        meshio::pack({.format = SourceDocument::Format::table, .arrays = some_arrays(mesh.positions.size())});
    for (std::size_t size = 0; size < good.size(); ++size) {
        const std::vector<std::byte> cut_short(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(size));
        EXPECT_FALSE(meshio::unpack(cut_short)) << size;
    }
    std::mt19937 random(1);
    int refused = 0, written = 0;
    for (int i = 0; i < 3000; ++i) {
        std::vector<std::byte> bytes = good;
        const std::size_t end = i % 4 ? 80 : bytes.size();
        for (int k = 0; k < 1 + i % 3; ++k) bytes[random() % end] = static_cast<std::byte>(random());
        const auto document = meshio::unpack(bytes);
        refused += !document;
        if (!document || i % 50 != 0) continue;
        Mesh with = mesh;
        with.document = bytes;
        const auto tree = require(build_tree(with.view()));
        for (const char* name : {"x.vtp", "x.stl", "x.ply", "x.glb"})
            written += meshio::write_cut(folder / name, part_cut(*tree, 1)).has_value();
    }
    EXPECT_GT(refused, 1000);
    EXPECT_GT(written, 40);
    // Fewer values than the mesh has vertices.
    const VertexTree tree = tree_with(mesh, some_arrays(mesh.positions.size() - 1));
    EXPECT_THAT(error_in(meshio::write_cut(folder / "x.ply", full_cut(tree))),
                HasSubstr("not that of the tree's mesh"));
}

// By the definition, one vertex after the other.
void expect_own_values(const Mesh& mesh) {
    const auto arrays = some_arrays(mesh.positions.size());
    const auto reals = values_of<double>(arrays[0]);
    const auto vectors = values_of<float>(arrays[1]);
    const auto labels = values_of<std::int64_t>(arrays[2]);
    const VertexTree built = tree_with(mesh, arrays);
    int proxies = 0, unfinite = 0;
    for (unsigned seed = 0; seed < 6; ++seed) {
        const Cut cut = seed == 0 ? full_cut(built) : part_cut(built, seed);
        const ExtractedMesh extracted = extract_with_sources(cut);
        const auto found = require(meshio::arrays_of_cut(cut, extracted, arrays));
        const auto found_reals = values_of<double>((*found)[0]);
        const auto found_vectors = values_of<float>((*found)[1]);
        const auto found_labels = values_of<std::int64_t>((*found)[2]);
        std::map<WedgeId, std::vector<Index>> sources;
        for (Index leaf = 0; leaf < built.leaf_count(); ++leaf)
            sources[cut.wedge_of_leaf(leaf)].push_back(built.source_vertices()[leaf]);
        for (std::size_t v = 0; v < extracted.wedges.size(); ++v) {
            const std::vector<Index>& all = sources.at(extracted.wedges[v]);
            if (extracted.wedges[v] >= built.interior_wedge_count()) {
                const Index source = all.at(0);
                EXPECT_EQ(std::memcmp(&found_reals[v], &reals[source], sizeof(double)), 0);
                EXPECT_EQ(std::memcmp(&found_vectors[3 * v], &vectors[3 * source], 3 * sizeof(float)), 0);
                EXPECT_EQ(found_labels[v], labels[source]);
                continue;
            }
            ++proxies;
            double sum = 0, sum_y = 0, count = 0, nearest = infinity;
            Index nearest_source = 0;
            for (const Index source : all) {
                if (std::isfinite(reals[source])) sum += reals[source], ++count;
                else ++unfinite;
                sum_y += static_cast<double>(vectors[3 * source + 1]);
                const double distance = glm::distance(mesh.positions[source], extracted.mesh.positions[v]);
                if (distance < nearest || (distance == nearest && source < nearest_source))
                    nearest = distance, nearest_source = source;
            }
            const double leaves = static_cast<double>(all.size());
            if (count == 0) EXPECT_EQ(std::memcmp(&found_reals[v], &reals[nearest_source], sizeof(double)), 0);
            else EXPECT_NEAR(found_reals[v], sum / count, 1e-14);
            EXPECT_NEAR(found_vectors[3 * v + 1], sum_y / leaves, 1e-6);
            EXPECT_EQ(found_labels[v], labels[nearest_source]);
        }
    }
    EXPECT_GT(proxies, 20);
    EXPECT_GT(unfinite, 20);
}

TEST(VertexValues, OfCutsAreThoseOfTheirVertices) {
    expect_own_values(shapes::bumpy_sphere(2));
    expect_own_values(SidedCube(4).mesh);
}

TEST(VertexValues, KeepVerticesAtOnePlaceApart) {
    const auto [mesh, sides] = SidedCube(3);
    const std::vector<VertexArray> arrays = {array_of("side", ValueType::float64, 1, sides)};
    const VertexTree tree = tree_with(mesh, arrays);
    EXPECT_EQ(tree.place_count(), 56u);
    EXPECT_EQ(tree.leaf_count(), 96u) << "sixteen on each side";
    const std::vector<double> ones(sides.size(), 1);
    EXPECT_EQ(tree_with(mesh, {array_of("one", ValueType::float64, 1, ones)}).leaf_count(), 56u);
    for (const unsigned seed : {0u, 1u, 2u, 3u}) {
        const Cut cut = seed == 0 ? full_cut(tree) : part_cut(tree, seed);
        const ExtractedMesh extracted = extract_with_sources(cut);
        const auto found = require(meshio::arrays_of_cut(cut, extracted, arrays));
        const auto values = values_of<double>((*found)[0]);
        for (const Triangle& t : extracted.mesh.triangles)
            for (const Index v : t) EXPECT_EQ(values[v], values[t[0]]) << "no mean of two sides";
    }
}

TEST(VertexValues, MeansStayWithinTheValues) {
    const Mesh mesh = shapes::icosphere(2);
    const std::size_t vertices = mesh.positions.size();
    std::vector<double> huge(vertices, std::numeric_limits<double>::max());
    const std::vector<VertexArray> arrays = {
        array_of("tenth", ValueType::float64, 1, std::vector<double>(vertices, 0.1)),
        array_of("nan", ValueType::float64, 1, std::vector<double>(vertices, nan)),
        array_of("infinite", ValueType::float32, 1,
                 std::vector<float>(vertices, std::numeric_limits<float>::infinity())),
        array_of("huge", ValueType::float64, 1, huge)};
    const VertexTree tree = tree_with(mesh, arrays);
    const Cut cut = part_cut(tree, 3);
    const auto found = require(meshio::arrays_of_cut(cut, extract_with_sources(cut), arrays));
    for (const double value : values_of<double>((*found)[0])) EXPECT_EQ(value, 0.1);
    for (const double value : values_of<double>((*found)[1])) EXPECT_TRUE(std::isnan(value));
    for (const float value : values_of<float>((*found)[2])) EXPECT_TRUE(std::isinf(value));
    for (const double value : values_of<double>((*found)[3])) EXPECT_EQ(value, huge[0]);
}

// By place, what a vertex has: bytes of all arrays but those of names that are not asked for.
std::map<std::array<double, 3>, std::string> by_place(const meshio::ReadResult& read,
                                                      const std::vector<std::string>& names) {
    std::map<std::array<double, 3>, std::string> found;
    for (std::size_t v = 0; v < read.mesh.positions.size(); ++v) {
        const glm::dvec3 p = read.mesh.positions[v];
        std::string& bytes = found[{p.x, p.y, p.z}];
        for (const std::string& name : names) {
            const VertexArray& array = named(read.document->arrays, name);
            const auto* first = reinterpret_cast<const char*>(array.values.data());
            bytes += meshio::name_of(array.type) + std::string(first + v * array.tuple_bytes(), array.tuple_bytes());
        }
    }
    return found;
}

meshio::ReadResult read_file(const std::filesystem::path& file) { return std::move(*require(meshio::read_mesh(file))); }

VertexTree tree_of(meshio::ReadResult read) {
    read.mesh.further = meshio::further_values(*read.document);
    read.mesh.document = meshio::pack(*read.document);
    return std::move(*require(build_tree(read.mesh.view())));
}

TEST(VertexValues, ComeOutOfAFullCutAsTheyWentIn) {
    const support::TempFolder folder;
    Mesh mesh = shapes::icosphere(2);
    for (glm::dvec3& position : mesh.positions) position = glm::dvec3(glm::vec3(position));
    std::vector<Message> notes;
    auto arrays = some_arrays(mesh.positions.size());
    for (const auto type : {ValueType::int8, ValueType::uint8})
        arrays.push_back(
            array_of<std::int8_t>(meshio::name_of(type), type, 1, std::vector<std::int8_t>(mesh.positions.size(), -7)));
    std::vector<std::string> names = meshio::names_of(arrays);
    ASSERT_TRUE(meshio::write_mesh_with(folder / "in.vtp", mesh.view(), arrays, notes));
    const VertexTree tree = tree_of(read_file(folder / "in.vtp"));
    ASSERT_TRUE(write_tree(folder / "t.vdt", tree));
    const auto in = by_place(read_file(folder / "in.vtp"), names);
    ASSERT_EQ(in.size(), mesh.positions.size());
    for (const auto& opened : {read_tree(folder / "t.vdt"), map_tree(folder / "t.vdt")}) {
        ASSERT_TRUE(opened) << opened.error().message;
        for (const char* name : {"out.vtp"}) {
            EXPECT_TRUE(require(meshio::write_cut(folder / name, full_cut(*opened)))->empty());
            EXPECT_EQ(by_place(read_file(folder / name), names), in) << name;
        }
    }

    // PLY to PLY, and by way of VTK.
    ASSERT_TRUE(meshio::write_cut(folder / "in.ply", full_cut(tree)));
    names = meshio::names_of(read_file(folder / "in.ply").document->arrays);
    EXPECT_THAT(names, ElementsAre("real", "vector_0", "vector_1", "vector_2", "label", "int8", "uint8"));
    const auto in_ply = by_place(read_file(folder / "in.ply"), names);
    const VertexTree ply_tree = tree_of(read_file(folder / "in.ply"));
    for (const std::string by : {"out.ply", "way.vtp"}) {
        ASSERT_TRUE(meshio::write_cut(folder / by, full_cut(ply_tree)));
        EXPECT_EQ(by_place(read_file(folder / by), names), in_ply) << by;
        ASSERT_TRUE(meshio::write_cut(folder / "back.ply", full_cut(tree_of(read_file(folder / by)))));
        EXPECT_EQ(by_place(read_file(folder / "back.ply"), names), in_ply) << by;
    }
}

TEST(VertexValues, OtherFormatsSayWhatTheyLeaveOut) {
    const support::TempFolder folder;
    const Mesh mesh = shapes::icosphere(1);
    const VertexTree tree = tree_with(mesh, some_arrays(mesh.positions.size()));
    for (const char* name : {"a.obj", "a.glb", "a.gltf"}) {
        const auto notes = require(meshio::write_cut(folder / name, full_cut(tree)));
        EXPECT_THAT(*notes, ElementsAre(HasSubstr("values of vertices were left out: 'real', 'vector' and 'label'")));
        EXPECT_EQ(read_file(folder / name).mesh.triangles.size(), mesh.triangles.size());
    }
}

TEST(VertexValues, HaveARange) {
    const VertexArray array = array_of<float>("a", ValueType::float32, 2, {1, 2, -3, NAN, INFINITY, 7});
    const meshio::ValueRange first = meshio::range_of(array, 0), second = meshio::range_of(array, 1);
    EXPECT_EQ(first.low, -3);
    EXPECT_EQ(first.high, 1);
    EXPECT_EQ(first.not_finite, 1u);
    EXPECT_EQ(second.low, 2);
    EXPECT_EQ(second.high, 7);
    EXPECT_EQ(second.not_finite, 1u);
    const meshio::ValueRange none = meshio::range_of(array_of<float>("b", ValueType::float32, 1, {NAN}), 0);
    EXPECT_GT(none.low, none.high);
}

} // namespace unseen::vdtree::vertex_values_test
