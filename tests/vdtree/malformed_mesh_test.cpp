// Files that lie, end early or were damaged: one clear sentence, no crash, no allocation out of proportion.
#include <unseen/meshio/mesh_file.h>
#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/tree_io.h>

#include "compressed_glb.h"
#include "gltf_data.h"
#include "largest_allocation.h"
#include "mesh_files.h"
#include "mesh_readers.h"
#include "shapes.h"
#include "temp_folder.h"
#include "testing.h"
#include "text_scanner.h"
#include "tree_file.h"
#include "vtp_files.h"

#include <nlohmann/json.hpp>

namespace unseen::vdtree {
namespace {

namespace fs = std::filesystem;
using namespace std::string_literals;

// What a reader may allocate at once: a vertex of one byte a coordinate becomes 60 bytes, and small files have
// overhead.
constexpr std::size_t allowed_bytes_per_byte = 64;
constexpr std::size_t allowed_bytes = 64 * 1024;

// Reads from memory that ends where the file ends, so that an address sanitizer sees every byte read too many.
Result<meshio::ReadResult> read_exactly(const std::string& bytes, const std::string& name,
                                        const meshio::ReadOptions& options = {}) {
    const std::unique_ptr<char[]> copy(new char[bytes.size()]);
    std::copy(bytes.begin(), bytes.end(), copy.get());
    largest_allocation = 0;
    Result<meshio::ReadResult> result = meshio::read_mesh_bytes({copy.get(), bytes.size()}, name, options);
    EXPECT_LE(largest_allocation.load(), allowed_bytes + allowed_bytes_per_byte * bytes.size()) << name;
    return result;
}

// Whatever loads must be a mesh; whatever does not must say so and name the file.
bool is_read_or_refused(const std::string& bytes, const std::string& name, const meshio::ReadOptions& options = {}) {
    const Result<meshio::ReadResult> result = read_exactly(bytes, name, options);
    if (!result) {
        EXPECT_TRUE(result.error().message.starts_with(name + ": ")) << result.error().message;
        return false;
    }
    EXPECT_FALSE(result->mesh.triangles.empty());
    const Result<void> valid = validate(result->mesh.view());
    EXPECT_TRUE(valid) << valid.error().message;
    return true;
}

std::string error_of(const std::string& bytes, const std::string& name) {
    const Result<meshio::ReadResult> result = read_exactly(bytes, name);
    EXPECT_FALSE(result) << name << " was read";
    return result ? "" : result.error().message;
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

std::vector<std::pair<std::string, std::string>> all_samples() {
    auto samples = mesh_files::samples();
    for (auto& sample : vtp_files::samples()) samples.push_back(std::move(sample));
    return samples;
}

// How many bytes a sample can lose and still be whole: its last newline, an OFF's colour, an OBJ's optional indices,
// what stands behind the data of a VTP.
std::size_t dispensable_bytes(const std::string& name) {
    if (name == "ascii.ply") return 1;
    if (name == "quad.off") return std::string(" 255 0 0\n").size();
    if (name == "ascii.stl") return std::string(" part one\n").size();
    if (name.starts_with("raw") || name.starts_with("base64"))
        return (vtp_files::VtpFile::tail_of_appended() + "</VTKFile>").size();
    return 0;
}

TEST(MalformedMesh, CutShortAtAnyByteIsAnError) {
    for (const auto& [name, bytes] : all_samples()) {
        ASSERT_TRUE(is_read_or_refused(bytes, name)) << name;
        for (std::size_t size = 0; size < bytes.size(); ++size) {
            const bool is_read = is_read_or_refused(bytes.substr(0, size), name);
            // An OBJ that ends after any line is an OBJ.
            if (name == "quad.obj") continue;
            EXPECT_EQ(is_read, size >= bytes.size() - dispensable_bytes(name))
                << name << " cut to " << size << " bytes";
        }
    }
}

TEST(MalformedMesh, CutShortAtTheFrontIsNoCrash) {
    for (const auto& [name, bytes] : all_samples()) {
        for (std::size_t start = 1; start < bytes.size(); ++start) is_read_or_refused(bytes.substr(start), name);
    }
}

TEST(MalformedMesh, DamagedAnywhereIsNoCrash) {
    constexpr int rounds = 4000;
    for (const auto& [name, original] : all_samples()) {
        std::mt19937 random(1234); // the same damage in every run
        int read = 0;
        for (int round = 0; round < rounds; ++round) {
            std::string bytes = original;
            const int flips = 1 + static_cast<int>(random() % 6);
            for (int i = 0; i < flips; ++i) {
                const std::size_t at = random() % bytes.size();
                if (round % 2 == 0) bytes[at] = static_cast<char>(bytes[at] ^ (1 << random() % 8));
                else bytes[at] = static_cast<char>(random() % 256);
            }
            read += is_read_or_refused(bytes, name);
        }
        // Damage to coordinates leaves a mesh, damage to structure does not: both happen.
        EXPECT_GT(read, 0) << name;
        EXPECT_LT(read, rounds) << name;
    }
}

TEST(MalformedMesh, WordsInWrongPlacesAreNoCrash) {
    const std::string words[] = {"-1",    "0",   "4294967296", "99999999999999999999",
                                 "1e999", "nan", "",           "\n",
                                 "{",     "]",   "2147483648", "-2147483648",
                                 "f",     "v",   "\\\n",       "\"",
                                 "#",     "1.5", "list",       "\0"s};
    for (const auto& [name, original] : all_samples()) {
        std::mt19937 random(99);
        for (int round = 0; round < 3000; ++round) {
            std::string bytes = original;
            const std::size_t at = random() % bytes.size();
            bytes.replace(at, random() % 4, words[random() % std::size(words)]);
            is_read_or_refused(bytes, name);
            is_read_or_refused(bytes, name, {.skip_bad = true});
        }
    }
}

const std::string huge_counts[] = {"2147483648",
                                   "4294967295",
                                   "4294967296",
                                   "9223372036854775807",
                                   "9223372036854775808",
                                   "18446744073709551615",
                                   "18446744073709551616",
                                   "-1",
                                   "1e3"};

TEST(MalformedMesh, PlyCountsAreCheckedAgainstTheBytes) {
    for (const std::string& file : {mesh_files::ascii_ply_quad(), mesh_files::binary_ply_quad(std::endian::little),
                                    mesh_files::binary_ply_quad(std::endian::big)}) {
        for (const std::string& count : huge_counts) {
            error_of(replaced(file, "element vertex 4", "element vertex " + count), "a.ply");
            error_of(replaced(file, "element face 1", "element face " + count), "a.ply");
            error_of(replaced(file, "element vertex", "element other " + count + "\nproperty char c\nelement vertex"),
                     "a.ply");
            error_of(replaced(file, "element vertex", "element other " + count + "\nelement vertex"), "a.ply");
        }
        EXPECT_THAT(error_of(replaced(file, "element vertex 4", "element vertex 5"), "a.ply"), HasSubstr("a.ply: "));
    }
}

TEST(MalformedMesh, PlyListsAreCheckedAgainstTheBytes) {
    std::string file = mesh_files::binary_ply_quad(std::endian::little);
    file[file.size() - 17] = '\xFF';
    EXPECT_THAT(error_of(file, "a.ply"), HasSubstr("face 0 claims 255 corners"));
    file = replaced(mesh_files::ascii_ply_quad(), "4 0 1 2 3", "4000000000 0 1 2 3");
    EXPECT_THAT(error_of(file, "a.ply"), HasSubstr("claims 4000000000 corners"));
    EXPECT_THAT(error_of(replaced(file, "4000000000", "-4"), "a.ply"), HasSubstr("claims -4 corners"));
}

TEST(MalformedMesh, PlyIndicesAreChecked) {
    const std::string file = mesh_files::binary_ply_quad(std::endian::little);
    for (const std::int32_t index :
         {4, -1, std::numeric_limits<std::int32_t>::max(), std::numeric_limits<std::int32_t>::min()}) {
        const std::string changed = file.substr(0, file.size() - 4) + mesh_files::little(index);
        EXPECT_THAT(error_of(changed, "a.ply"), HasSubstr("face 0 uses vertex " + std::to_string(index)));
    }
    for (const std::string index : {"4", "-1", "4294967296", "4294967297", "99999999999999999999", "1.5", "x"}) {
        EXPECT_THAT(error_of(replaced(mesh_files::ascii_ply_quad(), "1 2 3\n", "1 2 " + index + "\n"), "a.ply"),
                    HasSubstr("a.ply: line 15: "));
    }
    // Signs count for strips as well: only -1 starts a new one.
    const std::string strips =
        replaced(replaced(mesh_files::ascii_ply_quad(), "element face", "element tristrips"), "1 2 3\n", "1 2 -2\n");
    EXPECT_THAT(error_of(strips, "a.ply"), HasSubstr("strip 0 uses vertex -2"));
}

TEST(MalformedMesh, PlyHeadersAreChecked) {
    const std::string file = mesh_files::ascii_ply_quad();
    EXPECT_THAT(error_of(replaced(file, "end_header\n", ""), "a.ply"), HasSubstr("line 10"));
    EXPECT_THAT(error_of(file.substr(0, file.find("end_header")), "a.ply"), HasSubstr("no end_header"));
    EXPECT_THAT(error_of(replaced(file, "format ascii 1.0\n", ""), "a.ply"), HasSubstr("no format line"));
    EXPECT_THAT(error_of(replaced(file, "ascii 1.0", "ascii 2.0"), "a.ply"), HasSubstr("version '2.0'"));
    EXPECT_THAT(error_of(replaced(file, "ascii 1.0", "binary 1.0"), "a.ply"), HasSubstr("format 'binary'"));
    EXPECT_THAT(error_of(replaced(file, "property float y", "property real y"), "a.ply"), HasSubstr("line 6: 'real'"));
    EXPECT_THAT(error_of(replaced(file, "property float y", "property float q"), "a.ply"), HasSubstr("no x, y and z"));
    EXPECT_THAT(error_of(replaced(file, "list uchar", "list float"), "a.ply"), HasSubstr("'float'"));
    EXPECT_THAT(error_of(replaced(file, "vertex_index", "vertices"), "a.ply"),
                HasSubstr("no list named vertex_indices"));
    EXPECT_THAT(error_of(replaced(file, "element vertex 4\n", ""), "a.ply"), HasSubstr("before the first element"));
    EXPECT_THAT(error_of(replaced(file, "element face 1", "element face 0"), "a.ply"), HasSubstr("no faces"));
    EXPECT_THAT(error_of(replaced(file, "elem", "e\0em"s), "a.ply"), HasSubstr("line 4"));
}

// By their own digits: what a locale makes of them does not count.
TEST(MalformedMesh, NumbersBeyondDoublesAreInfiniteOrZero) {
    constexpr double infinity = std::numeric_limits<double>::infinity();
    const std::string zeros(400, '0');
    const std::pair<std::string, double> cases[] = {{"1e400", infinity},
                                                    {"-1.5E+400", -infinity},
                                                    {"0.001e400", infinity},
                                                    {"1" + zeros, infinity},
                                                    {"-1" + zeros + ".5", -infinity},
                                                    {"1e-400", 0},
                                                    {"-2.5e-400", 0},
                                                    {"1000e-400", 0},
                                                    {"0." + zeros + "1", 0},
                                                    {"1e99999999999999999999", infinity},
                                                    {"1e-99999999999999999999", 0},
                                                    {"0." + zeros + "1e-5", 0},
                                                    {"+1e400", infinity}};
    for (const auto& [text, expected] : cases) {
        double value = 1;
        EXPECT_TRUE(meshio::to_number(text, value)) << text;
        EXPECT_EQ(value, expected) << text;
    }
}

TEST(MalformedMesh, CoordinatesMustBeFinite) {
    for (const std::string value : {"nan", "-nan", "inf", "-inf", "1e400", "infinity"}) {
        EXPECT_THAT(error_of(replaced(mesh_files::ascii_ply_quad(), "1 1 0", "1 " + value + " 0"), "a.ply"),
                    HasSubstr("vertex 2 has"));
        EXPECT_THAT(error_of(replaced(mesh_files::obj_quad(), "v 1 1 0", "v 1 " + value + " 0"), "a.obj"),
                    HasSubstr("line 4: vertex 3"));
        EXPECT_THAT(error_of(replaced(mesh_files::off_quad(), "1 1 0", "1 " + value + " 0"), "a.off"),
                    HasSubstr("line 6: vertex 2 has"));
        EXPECT_THAT(error_of(replaced(mesh_files::ascii_stl_facet(), "1 0 0", "1 " + value + " 0"), "a.stl"),
                    HasSubstr("facet 0 has"));
    }
    std::string stl = mesh_files::binary_stl_facet();
    stl.replace(84 + 12, 4, mesh_files::floats(std::numeric_limits<float>::infinity()));
    EXPECT_THAT(error_of(stl, "a.stl"), HasSubstr("facet 0 has"));
    EXPECT_THAT(error_of(replaced(mesh_files::glb_triangle(), mesh_files::floats(1, 0, 0),
                                  mesh_files::floats(std::numeric_limits<float>::quiet_NaN(), 0, 0)),
                         "a.glb"),
                HasSubstr("vertex 1 of accessor 0 has"));
}

// Three triangles, the second with a vertex that is NaN, the third with one that is not there: in every format that has
// indices.
const std::string three_ply = "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\n"
                              "property float z\nelement face 3\nproperty list uchar int vertex_index\nend_header\n"
                              "inf 0 0\n0 0 0\n1 0 0\n1 nan 0\n0 1 0\n3 1 2 4\n3 1 2 3\n3 1 2 9\n";
const std::string three_obj = "v inf 0 0\nv 0 0 0\nv 1 0 0\nv 1 nan 0\nv 0 1 0\nf 2 3 5\nf 2 3 4\nf 2 3 10\n";
const std::string three_off = "OFF\n5 3 0\ninf 0 0\n0 0 0\n1 0 0\n1 nan 0\n0 1 0\n3 1 2 4\n3 1 2 3\n3 1 2 9\n";

TEST(MalformedMesh, BadVerticesAndFacesAreCountedAndTheFirstIsNamed) {
    EXPECT_EQ(error_of(three_obj, "a.obj"),
              "a.obj: line 1: vertex 1 has a NaN or infinite coordinate (the first of 2 such vertices); line 8: face 3 "
              "uses vertex 10, but there are 5. Correct it, or leave out the faces concerned with read.skip_bad.");
    EXPECT_THAT(error_of(three_ply, "a.ply"), HasSubstr("vertex 0 has a NaN or infinite coordinate (the first of 2"));
    EXPECT_THAT(error_of(three_off, "a.off"),
                HasSubstr("line 3: vertex 0 has a NaN or infinite coordinate (the first"));
}

TEST(MalformedMesh, BadVerticesAndFacesAreLeftOutWhereAsked) {
    meshio::ReadOptions options;
    options.skip_bad = true;
    std::string gltf = mesh_files::gltf_triangle_data();
    gltf.replace(40, 2, "\7\0"s); // the last index
    const std::string none_left = mesh_files::glb(mesh_files::gltf_triangle_json(), gltf);
    for (const auto& [name, bytes] :
         {std::pair("a.ply", three_ply), std::pair("a.obj", three_obj), std::pair("a.off", three_off)}) {
        const Result<meshio::ReadResult> read = require(meshio::read_mesh_bytes(bytes, name, options));
        EXPECT_EQ(read->bad.vertices, 2u) << name;
        EXPECT_EQ(read->bad.faces, 1u) << name;
        EXPECT_EQ(read->bad.left_out, 2u) << name;
        EXPECT_EQ(read->source_faces, 3u) << name;
        EXPECT_EQ(read->dropped_triangles, 0u) << name;
        EXPECT_EQ(read->mesh.triangles, (std::vector<Triangle>{{1, 2, 4}})) << name;
        EXPECT_TRUE(validate(read->mesh.view())) << name;
        ASSERT_EQ(read->warnings.size(), 1u) << name;
        EXPECT_THAT(read->warnings[0], HasSubstr("2 faces were left out: ")) << name;
    }
    const Result<meshio::ReadResult> none = meshio::read_mesh_bytes(none_left, "a.glb", options);
    ASSERT_FALSE(none);
    EXPECT_EQ(none.error().message, "a.glb: no face is left without the bad ones: mesh 'tri': index 2 names vertex 7, "
                                    "but there are 3.");
}

TEST(MalformedMesh, BadFacetsOfStlAreLeftOutWhereAsked) {
    std::string stl = mesh_files::binary_stl_facet();
    stl += stl.substr(84);
    stl[80] = 2;
    stl.replace(84 + 50 + 16, 4, mesh_files::floats(std::numeric_limits<float>::quiet_NaN()));
    EXPECT_EQ(error_of(stl, "a.stl"), "a.stl: facet 1 has a NaN or infinite coordinate. Correct it, or leave out the "
                                      "faces concerned with read.skip_bad.");
    meshio::ReadOptions options;
    options.skip_bad = true;
    const Result<meshio::ReadResult> read = require(meshio::read_mesh_bytes(stl, "a.stl", options));
    EXPECT_EQ(read->mesh.triangles.size(), 1u);
    EXPECT_EQ(read->mesh.positions.size(), 3u);
    EXPECT_EQ(read->bad.left_out, 1u);
}

TEST(MalformedMesh, PolygonsAndStripsLoseOnlyWhatIsBad) {
    meshio::ReadOptions options;
    options.skip_bad = true;
    const std::string strip = "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\n"
                              "property float z\nelement tristrips 1\nproperty list int int vertex_indices\n"
                              "end_header\nnan 0 0\n0 1 0\n1 0 0\n1 1 0\n2 0 0\n2 1 0\n6 0 1 2 3 4 5\n";
    const Result<meshio::ReadResult> read = require(meshio::read_mesh_bytes(strip, "a.ply", options));
    EXPECT_EQ(read->mesh.triangles.size(), 3u);
    EXPECT_EQ(read->bad.left_out, 1u);
    const std::string quads = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 nan\nf 1 2 3 4\nf 1 2 3\n";
    const Result<meshio::ReadResult> rest = require(meshio::read_mesh_bytes(quads, "a.obj", options));
    EXPECT_EQ(rest->mesh.triangles, (std::vector<Triangle>{{0, 1, 2}})); // nothing of the quad
}

TEST(MalformedMesh, AMeshWithoutTrianglesIsAnError) {
    for (const auto& [bytes, name] :
         {std::pair(""s, "a.ply"), std::pair(""s, "a.obj"), std::pair(" \n\n"s, "a.obj"),
          std::pair("v 0 0 0\nl 1 1\n"s, "a.obj"), std::pair("v 0 0 0\nf 1\nf 1 1\n"s, "a.obj"),
          std::pair("v 0 0 0\nf 1 1 1\n"s, "a.obj"), std::pair("OFF 1 0 0\n0 0 0\n"s, "a.off"),
          std::pair("OFF 0 0 0\n"s, "a.off"), std::pair("solid\nendsolid\n"s, "a.stl"),
          std::pair(std::string(84, '\0'), "a.stl"), std::pair("{\"asset\":{\"version\":\"2.0\"}}"s, "a.gltf")}) {
        EXPECT_THAT(error_of(bytes, name), HasSubstr(name));
    }
}

TEST(MalformedMesh, ObjIndicesAreChecked) {
    const std::string vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\n";
    for (const std::string corner :
         {"0", "4", "-4", "4294967297", "-4294967295", "9223372036854775808", "-9223372036854775808",
          "-99999999999999999999", "3/1/1/1", "/1", "3.5", "x", "3x", "--1", "+-1", "3/x"}) {
        EXPECT_THAT(error_of(vertices + "f 1 2 " + corner + "\n", "a.obj"), HasSubstr("a.obj: line 6: ")) << corner;
    }
}

TEST(MalformedMesh, ObjNumbersAreChecked) {
    for (const std::string numbers :
         {"1 2", "", "1 2 3 4 5", "1 2 3 4 5 6 7 8", "1 2 x", "1 2 3.1+e2", "1 2 1.#IND", "1 2 0x10"}) {
        EXPECT_THAT(error_of("v " + numbers + "\nf 1 1 1\n", "a.obj"), HasSubstr("a.obj: line 1: vertex 1")) << numbers;
    }
    EXPECT_THAT(error_of("v 0 0 0\nvt\nvn 0 0\n", "a.obj"), HasSubstr("line 2"));
    EXPECT_THAT(error_of("v 0 0 0\nvn 0 0\n", "a.obj"), HasSubstr("line 2"));
    EXPECT_THAT(error_of("v 0 0 0\n\0\0\0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"s, "a.obj"), HasSubstr("line 2: a NUL byte"));
}

TEST(MalformedMesh, OffCountsAndIndicesAreChecked) {
    for (const std::string& count : huge_counts) {
        error_of(replaced(mesh_files::off_quad(), "4 1 0", count + " 1 0"), "a.off");
        error_of(replaced(mesh_files::off_quad(), "4 1 0", "4 " + count + " 0"), "a.off");
        error_of(replaced(mesh_files::off_quad(), "4 0 1 2 3", count + " 0 1 2 3"), "a.off");
        EXPECT_THAT(error_of(replaced(mesh_files::off_quad(), "4 0 1 2 3", "4 0 1 2 " + count), "a.off"),
                    HasSubstr("a.off: line 8: face 0"));
    }
    EXPECT_THAT(error_of("OFF BINARY\n", "a.off"), HasSubstr("binary OFF"));
    EXPECT_THAT(error_of("4OFF 1 0 0\n", "a.off"), HasSubstr("4OFF"));
}

TEST(MalformedMesh, StlCountsAreCheckedAgainstTheBytes) {
    for (const std::uint32_t count : {2u, 0x80000000u, 0xFFFFFFFFu, 0x55555555u, 0x51EB851Fu}) {
        EXPECT_THAT(error_of(mesh_files::binary_stl_facet().replace(80, 4, mesh_files::little(count)), "a.stl"),
                    HasSubstr("claims " + std::to_string(count) + " facets"));
    }
}

std::string glb_with(const std::string& from, const std::string& to) {
    return mesh_files::glb(replaced(mesh_files::gltf_triangle_json(), from, to), mesh_files::gltf_triangle_data());
}

TEST(MalformedMesh, GltfSizesAndNumbersAreChecked) {
    const std::pair<std::string, std::string> changes[] = {
        {R"("componentType":5126,"count":3)", R"("componentType":5126,"count":4)"},
        {R"("componentType":5126,"count":3)", R"("componentType":5126,"count":9007199254740992)"},
        {R"("componentType":5126,"count":3)", R"("componentType":5126,"count":18446744073709551615)"},
        {R"("componentType":5126,"count":3)", R"("componentType":5126,"count":-3)"},
        {R"("componentType":5126,"count":3)", R"("componentType":5126,"count":"3")"},
        {R"("componentType":5126,"count":3)", R"("componentType":5126,"byteOffset":4,"count":3)"},
        {R"("componentType":5126,"count":3)", R"("componentType":5126,"byteOffset":9007199254740991,"count":3)"},
        {R"("componentType":5126,"count":3)", R"("componentType":5130,"count":3)"},
        {R"("componentType":5126,"count":3)", R"("componentType":1,"count":3)"},
        {R"("componentType":5126,"count":3)", R"("count":3)"},
        {R"("type":"VEC3")", R"("type":"VEC2")"},
        {R"("type":"VEC3")", R"("type":"MAT4")"},
        {R"("type":"VEC3")", R"("type":7)"},
        {R"("type":"SCALAR")", R"("type":"VEC3")"},
        {R"("componentType":5123)", R"("componentType":5122)"},
        {R"("componentType":5123)", R"("componentType":5125)"},
        {R"("bufferView":0)", R"("bufferView":2)"},
        {R"("bufferView":0)", R"("bufferView":4294967296)"},
        {R"("bufferView":0,)", ""},
        {R"("buffer":0)", R"("buffer":1)"},
        {R"("buffer":0)", R"("buffer":-1)"},
        {R"("byteLength":36)", R"("byteLength":37000)"},
        {R"("byteLength":36)", R"("byteOffset":9007199254740992,"byteLength":36)"},
        {R"("byteLength":36)", R"("byteStride":8,"byteLength":36)"},
        {R"("byteLength":36)", R"("byteStride":16,"byteLength":36)"},
        {R"("byteLength":36)", R"("byteStride":3,"byteLength":36)"},
        {R"("byteLength":42)", R"("byteLength":4200)"},
        {R"("byteLength":42)", R"("byteLength":-1)"},
        {R"("byteLength":42)", R"("uri":"data:x;base64,AAAA","byteLength":42)"},
        {R"("byteLength":42)", R"("uri":"data:x;base64,!!!!","byteLength":42)"},
        {R"("byteLength":42)", R"("uri":"data.bin","byteLength":42)"},
        {R"({"byteLength":42})", R"({"byteLength":42},{"byteLength":42})"},
        {R"("POSITION":0)", R"("POSITION":2)"},
        {R"("POSITION":0)", R"("POSITION":1)"},
        {R"("POSITION":0)", R"("POSITION":0,"NORMAL":1)"},
        {R"("POSITION":0)", R"("NORMAL":0)"},
        {R"("indices":1)", R"("indices":2)"},
        {R"("indices":1)", R"("indices":0)"},
        {R"("indices":1)", R"("indices":1,"material":0)"},
        {R"("indices":1)", R"("indices":1,"mode":7)"},
        {R"("nodes":[0]}])", R"("nodes":[1]}])"},
        {R"("nodes":[0]}])", R"("nodes":[0,0]}])"},
        {R"("scene":0)", R"("scene":1)"},
        {R"({"mesh":0})", R"({"mesh":1})"},
        {R"({"mesh":0})", R"({"mesh":0,"children":[0]})"},
        {R"({"mesh":0})", R"({"mesh":0,"matrix":[1,2,3]})"},
        {R"({"mesh":0})", R"({"mesh":0,"rotation":[0,0,0,0]})"},
        {R"({"mesh":0})", R"({"mesh":0,"translation":[1e308,0,0],"scale":[1e308,1e308,1e308]},{})"},
        {R"({"mesh":0})", R"({"mesh":0,"translation":[1e999,0,0]})"},
        {R"("version":"2.0")", R"("version":"1.0")"},
        {R"("asset":{"version":"2.0"},)", ""},
        {R"("scene":0)", R"("extensionsRequired":["KHR_draco_mesh_compression"],"scene":0)"},
        {R"("accessors":[)", R"("accessors":[7,)"},
        {R"("meshes":[)", R"("meshes":7,"unused":[)"},
    };
    for (const auto& [from, to] : changes) {
        const std::string bytes = glb_with(from, to);
        if (to.find("1e308") != std::string::npos) {
            is_read_or_refused(bytes, "a.glb"); // large, but within double
            continue;
        }
        EXPECT_FALSE(is_read_or_refused(bytes, "a.glb")) << to;
    }
    std::string wrong_index = mesh_files::gltf_triangle_data();
    wrong_index[40] = 3;
    EXPECT_THAT(error_of(mesh_files::glb(mesh_files::gltf_triangle_json(), wrong_index), "a.glb"),
                HasSubstr("index 2 names vertex 3"));
}

TEST(MalformedMesh, GltfNodesMustFormTreesOfReasonableDepth) {
    EXPECT_THAT(error_of(glb_with(R"([{"mesh":0}])", R"([{"children":[1]},{"mesh":0,"children":[0]}])"), "a.glb"),
                HasSubstr("node 0 is reached twice"));
    EXPECT_THAT(error_of(glb_with(R"([{"mesh":0}])", R"([{"children":[1,2]},{"children":[2]},{"mesh":0}])"), "a.glb"),
                HasSubstr("node 2 is reached twice"));
    std::string chain;
    for (int i = 1; i < 5000; ++i) chain += R"({"children":[)" + std::to_string(i) + "]},";
    EXPECT_THAT(error_of(glb_with(R"([{"mesh":0}])", "[" + chain + R"({"mesh":0}])"), "a.glb"),
                HasSubstr("nested too deeply"));
}

TEST(MalformedMesh, GltfJsonMayNotBeNestedDeeply) {
    for (const std::string open : {"[", "{\"a\":"}) {
        std::string nested;
        for (int i = 0; i < 200000; ++i) nested += open;
        EXPECT_THAT(error_of(glb_with(R"("scene":0)", R"("scene":0,"extras":)" + nested), "a.glb"),
                    HasSubstr("nested too deeply"));
        EXPECT_THAT(error_of("{\"asset\":" + nested, "a.gltf"), HasSubstr("nested too deeply"));
    }
}

// The parser takes a NUL byte for the end, and what comes after it would not count.
TEST(MalformedMesh, GltfJsonHasNoNulBytes) {
    const std::string data = mesh_files::gltf_triangle_data();
    const std::string json = mesh_files::gltf_triangle_json(
        R"([{"mesh":0}])", R"({"byteLength":42,"uri":"data:;base64,)" + vtp_files::base64(data) + R"("})");
    ASSERT_TRUE(is_read_or_refused(json, "a.gltf"));
    for (const std::string& behind : {"\0"s, "\0{}"s, " \n\0"s})
        EXPECT_THAT(error_of(json + behind, "a.gltf"), HasSubstr("a NUL byte, which no JSON contains"));
    EXPECT_THAT(error_of("\0"s + json, "a.gltf"), HasSubstr("a.gltf: "));
    // Chunks of GLB files may be filled up so, by less than a word.
    std::string filled = mesh_files::gltf_triangle_json();
    while (filled.size() % 4 != 1) filled += ' ';
    EXPECT_TRUE(is_read_or_refused(mesh_files::glb(filled + "\0\0\0"s, data), "a.glb"));
    EXPECT_THAT(error_of(mesh_files::glb(filled + "\0\0\0\0\0\0\0"s, data), "a.glb"), HasSubstr("a NUL byte"));
}

TEST(MalformedMesh, GltfInstancesMayNotMultiplyWithoutLimit) {
    // 20,000 nodes that show one mesh of 20,000 triangles: 600 kB that would become 400 million triangles.
    std::string data, nodes, list;
    constexpr int count = 20000;
    for (int i = 0; i < 3 * count; ++i) data += mesh_files::little(static_cast<std::uint16_t>(i % 3));
    for (int i = 0; i < count; ++i) {
        nodes += R"({"mesh":0},)";
        list += std::to_string(i) + ",";
    }
    std::string json = mesh_files::gltf_triangle_json("[" + nodes + R"({"mesh":0}])");
    json = replaced(json, R"("nodes":[0])", R"("nodes":[)" + list + std::to_string(count) + "]");
    json = replaced(json, R"("componentType":5123,"count":3)",
                    R"("componentType":5123,"count":)" + std::to_string(3 * count));
    json = replaced(json, R"("byteLength":6)", R"("byteLength":)" + std::to_string(6 * count));
    json = replaced(json, R"("byteLength":42)", R"("byteLength":)" + std::to_string(36 + 6 * count));
    const std::string file = mesh_files::glb(json, mesh_files::gltf_triangle_data().substr(0, 36) + data);
    EXPECT_THAT(error_of(file, "a.glb"), HasSubstr("multiply"));
}

TEST(MalformedMesh, GltfEmptyPrimitivesMayNotMultiplyEither) {
    // 10,000 nodes that show one mesh of 10,000 primitives without triangles: nothing to store, but time to spend.
    std::string primitives, nodes, list;
    for (int i = 0; i < 10000; ++i) {
        primitives += R"({"mode":0,"attributes":{}},)";
        nodes += R"({"mesh":0},)";
        list += std::to_string(i) + ",";
    }
    std::string json = mesh_files::gltf_triangle_json("[" + nodes + R"({"mesh":0}])");
    json = replaced(json, R"("nodes":[0])", R"("nodes":[)" + list + "10000]");
    json = replaced(json, R"("primitives":[)", R"("primitives":[)" + primitives);
    EXPECT_THAT(error_of(mesh_files::glb(json, mesh_files::gltf_triangle_data()), "a.glb"), HasSubstr("multiply"));
}

TEST(MalformedMesh, GltfBuffersAreReadOnceAndNoFurtherThanNeeded) {
    const support::TempFolder folder;
    support::write_bytes(folder / "data.bin", mesh_files::gltf_triangle_data());
    fs::resize_file(folder / "data.bin", std::uintmax_t{1} << 26);
    nlohmann::json document = {{"buffers", nlohmann::json::array()}};
    for (std::string name = "data.bin"; document["buffers"].size() < 24; name = "./" + name)
        document["buffers"].push_back({{"byteLength", 42}, {"uri", name}});
    const meshio::ReadOptions options;
    const meshio::MeshSource source{"", "a.gltf", folder.path(), options};
    largest_allocation = 0;
    const meshio::gltf::Buffers buffers(source, document, std::nullopt);
    EXPECT_LE(largest_allocation.load(), allowed_bytes);
    EXPECT_EQ(buffers.external_bytes(), 42u);
    for (std::size_t i = 0; i < buffers.count(); ++i) EXPECT_EQ(buffers[i], mesh_files::gltf_triangle_data());
}

TEST(MalformedMesh, GltfJsonMayNotHaveMillionsOfNodes) {
    std::string nodes;
    for (int i = 0; i < (1 << 20) + 1; ++i) nodes += "{},";
    EXPECT_THAT(error_of(glb_with(R"([{"mesh":0}])", "[" + nodes + "{}]"), "a.glb"), HasSubstr("nodes, more than"));
    std::string values = "0";
    for (int i = 0; i < 9'000'000; ++i) values += ",0";
    EXPECT_THAT(error_of(glb_with(R"("scene":0)", R"("scene":0,"extras":[)" + values + "]"), "a.glb"),
                HasSubstr("too many values"));
}

TEST(MalformedMesh, GltfZerosAreNotFree) {
    const std::string sparse = R"("componentType":5126,"count":2000000000,"type":"VEC3","sparse":{"count":1,)"
                               R"("indices":{"bufferView":1,"componentType":5123},"values":{"bufferView":0}})";
    EXPECT_THAT(error_of(glb_with(R"("bufferView":0,"componentType":5126,"count":3,"type":"VEC3")", sparse), "a.glb"),
                HasSubstr("multiply"));
}

TEST(MalformedMesh, GlbChunksAreChecked) {
    const std::string file = mesh_files::glb_triangle();
    for (const std::size_t at : {4u, 8u, 12u, 16u}) {
        for (const std::uint32_t value : {0u, 1u, 3u, 0x7FFFFFFFu, 0xFFFFFFFFu, 0xFFFFFFF0u}) {
            std::string changed = file;
            EXPECT_FALSE(is_read_or_refused(changed.replace(at, 4, mesh_files::little(value)), "a.glb"))
                << at << " " << value;
        }
    }
}

TEST(MalformedMesh, CompressedGltfIsChecked) {
    const std::string file = mesh_files::compressed_glb();
    if (file.empty()) GTEST_SKIP() << "this build is without meshoptimizer";
    EXPECT_EQ(require(meshio::read_mesh_bytes(file, "levels.glb"))->mesh.triangles.size(), 80u);
    std::uint32_t json_size = 0;
    std::memcpy(&json_size, file.data() + 12, 4);
    const auto document = nlohmann::json::parse(file.substr(20, json_size));
    const std::string bin = file.substr(20 + json_size + 8);
    // All numbers of the first view of each mode.
    std::set<std::string> modes;
    for (std::size_t i = 0; i < document["bufferViews"].size(); ++i) {
        const auto at =
            nlohmann::json::json_pointer("/bufferViews/" + std::to_string(i) + "/extensions/EXT_meshopt_compression");
        if (!document.contains(at) || !modes.insert(document[at]["mode"]).second) continue;
        for (const char* key : {"buffer", "byteOffset", "byteLength", "byteStride", "count", "mode", "filter"})
            for (const nlohmann::json& value :
                 {nlohmann::json(-1), nlohmann::json(std::int64_t{1} << 53), nlohmann::json(1e300), nlohmann::json(7),
                  nlohmann::json("EXPONENTIAL"), nlohmann::json(nullptr), nlohmann::json::array()}) {
                auto changed = document;
                changed[at][key] = value;
                largest_allocation = 0;
                const bool is_read = is_read_or_refused(mesh_files::glb(changed.dump(), bin), "levels.glb");
                EXPECT_LT(largest_allocation, 100 * file.size()) << key << " " << value;
                const bool is_filter = std::string(key) == "filter";
                EXPECT_TRUE(!is_read || is_filter) << i << " " << key << " " << value;
            }
    }
    EXPECT_GE(modes.size(), 2u);
    // Many views of the same bytes.
    auto many = document;
    for (int i = 0; i < 200'000; ++i) many["bufferViews"].push_back(document["bufferViews"][0]);
    EXPECT_FALSE(is_read_or_refused(mesh_files::glb(many.dump(), bin), "levels.glb"));
    std::mt19937 random(1234);
    for (int round = 0; round < 4000; ++round) {
        std::string damaged = file;
        for (int k = 0; k < 3; ++k)
            damaged[20 + json_size + random() % (damaged.size() - 20 - json_size)] ^=
                static_cast<char>(1 << random() % 8);
        is_read_or_refused(damaged, "levels.glb");
    }
}

enum class Expected { loads, error, either };

// What is known about files of these names in a folder named malformed; others may load or not.
const std::map<std::string, Expected> expectations{
    {"OutOfMemory.off", Expected::error},
    {"all_coincident.ply", Expected::either},
    {"all_same_vertex.ply", Expected::error},
    {"ascii_body_short.ply", Expected::error},
    {"big_endian.ply", Expected::loads},
    {"binary_named_solid.stl", Expected::loads},
    {"bitflips_header.ply", Expected::error},
    {"box_without_lineending.obj", Expected::loads},
    {"cgal_degtri_sliding.off", Expected::loads},
    {"cgal_oblong-shuffled.off", Expected::loads},
    {"concave_polygon.obj", Expected::loads},
    {"count_2p32.stl", Expected::error},
    {"cube_binary_header_with_RN_newline.ply", Expected::loads},
    {"degenerated.obj", Expected::loads},
    {"duplicate_faces_fins.ply", Expected::loads},
    {"empty.obj", Expected::error},
    {"empty.ply", Expected::error},
    {"face_count_2p31.ply", Expected::error},
    {"header_no_end.ply", Expected::error},
    {"huge_index.obj", Expected::error},
    {"huge_offset_f8.ply", Expected::loads},
    {"huge_scale.ply", Expected::loads},
    {"index_negative.ply", Expected::error},
    {"index_out_of_range.ply", Expected::error},
    {"issue-140-zero-face-idx.obj", Expected::error},
    {"issue-319-003.obj", Expected::loads},
    {"issue623.ply", Expected::error},
    {"list_count_255.ply", Expected::error},
    {"malformed.obj", Expected::error},
    {"mixed_newlines.obj", Expected::loads},
    {"moebius.ply", Expected::loads},
    {"nan_inf_coords.ply", Expected::error},
    {"negative_index_out_of_range.obj", Expected::error},
    {"negative_indices.obj", Expected::loads},
    {"non_manif_hole.ply", Expected::loads},
    {"nul_bytes.obj", Expected::error},
    {"number_formats.obj", Expected::error},
    {"off_counts_on_first_line.off", Expected::loads},
    {"platonic_shelf_ascii.ply", Expected::loads},
    {"platonic_shelf_big_endian.ply", Expected::loads},
    {"ply_empty_bin.ply", Expected::error},
    {"points.ply", Expected::error},
    {"polygonfaces.obj", Expected::loads},
    {"property_order_zyx.ply", Expected::loads},
    {"single_triangle.ply", Expected::loads},
    {"single_vertex.ply", Expected::error},
    {"soup.stl", Expected::loads},
    {"test-nan.obj", Expected::error},
    {"testline.obj", Expected::error},
    {"tiny_scale.ply", Expected::loads},
    {"trunc_in_faces.ply", Expected::error},
    {"trunc_in_vertices.ply", Expected::error},
    {"truncated.stl", Expected::error},
    {"vertex_count_4294967295.ply", Expected::error},
    {"vertex_count_negative.ply", Expected::error},
    {"zero_area_slivers.ply", Expected::loads},
};

bool is_mesh_name(const fs::path& name) {
    const std::string ending = name.extension().string();
    return ending == ".ply" || ending == ".obj" || ending == ".off" || ending == ".stl" || ending == ".gltf" ||
           ending == ".glb";
}

// The bytes of a file, or what `zstd` makes of them.
std::string bytes_of(const fs::path& file, const fs::path& temporary) {
    fs::path plain = file;
    if (file.extension() == ".zst") {
        plain = temporary;
        const std::string command = "zstd -q -d -f -o '" + temporary.string() + "' '" + file.string() + "'";
        EXPECT_EQ(std::system(command.c_str()), 0) << command;
    }
    std::ifstream stream(plain, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

void check_further_mesh(const fs::path& file, const fs::path& temporary) {
    const fs::path name = file.extension() == ".zst" ? file.stem() : file.filename();
    if (!is_mesh_name(name)) return;
    SCOPED_TRACE(file.string());
    const bool is_read = is_read_or_refused(bytes_of(file, temporary), name.string());
    Expected expected = Expected::loads;
    if (file.parent_path().filename() == "malformed") {
        const auto found = expectations.find(name.string());
        expected = found == expectations.end() ? Expected::either : found->second;
    }
    if (expected != Expected::either) EXPECT_EQ(is_read, expected == Expected::loads);
}

TEST(MalformedMesh, FurtherMeshesLoadOrFailAsExpected) {
    const char* folder = std::getenv("UNSEEN_EXTRA_MESHES");
    if (folder == nullptr) GTEST_SKIP() << "UNSEEN_EXTRA_MESHES names no folder of further meshes";
    if (std::system("zstd --version > /dev/null 2>&1") != 0) GTEST_SKIP() << "the program zstd is not there";
    const fs::path temporary = fs::temp_directory_path() / ("unseen-mesh-" + std::to_string(std::random_device{}()));
    int files = 0;
    for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder)) {
        if (!entry.is_regular_file()) continue;
        check_further_mesh(entry.path(), temporary);
        ++files;
    }
    fs::remove(temporary);
    EXPECT_GT(files, 0) << folder << " is empty";
}

// Tables of sections that claim what is not there: one section, or each, the whole file or more than any disk has.
TEST(MalformedTree, AsksForNoMoreMemoryThanItsFileIsWorth) {
    using support::TreeFile;
    const auto tree = require(build_tree(shapes::cube(1).view()));
    const support::TempFolder folder;
    const fs::path file = folder / "t.vdt";
    ASSERT_TRUE(write_tree(file, *tree));
    const std::string good = support::read_bytes(file);
    const std::size_t sections = TreeFile::parse(good).sections.size();
    const auto claim = [](std::string& bytes, std::size_t section, std::uint64_t size) {
        const std::size_t entry = TreeFile::header_bytes + section * TreeFile::entry_bytes;
        const auto each = support::load<std::uint32_t>(bytes, entry + TreeFile::element_bytes_at);
        support::store(bytes, entry + TreeFile::offset_at, std::uint64_t{0});
        support::store(bytes, entry + TreeFile::count_at, size / each);
    };
    const auto expect_refused = [&](std::string bytes, std::size_t section) {
        TreeFile::seal(bytes);
        support::write_bytes(file, bytes);
        largest_allocation = 0;
        const auto read = read_tree(file);
        EXPECT_LE(largest_allocation.load(), allowed_bytes + allowed_bytes_per_byte * bytes.size()) << section;
        ASSERT_FALSE(read) << section;
        EXPECT_THAT(read.error().message, HasSubstr("t.vdt")) << section;
    };
    constexpr std::uint64_t no_disk = std::uint64_t{1} << 50;
    for (const std::uint64_t size : {std::uint64_t{good.size()}, no_disk}) {
        std::string all = good;
        for (std::size_t i = 0; i < sections; ++i) {
            std::string one = good;
            claim(one, i, size);
            expect_refused(std::move(one), i);
            claim(all, i, size);
        }
        expect_refused(std::move(all), sections);
    }
    std::string longer = good;
    support::store(longer, TreeFile::file_bytes_at, no_disk);
    expect_refused(std::move(longer), sections);
}

} // namespace
} // namespace unseen::vdtree
