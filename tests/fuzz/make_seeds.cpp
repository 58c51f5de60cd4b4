// Small files for the fuzz targets to begin with: make_fuzz_seeds FOLDER writes FOLDER/{mesh,tree,follow}/.
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <stdexcept>
#include <string>

#include <meshio/mesh_io.h>
#include <vdtree/builder.h>
#include <vdtree/tree_io.h>

#include "built.h"
#include "shapes.h"
#include "vtk_files.h"

namespace {

namespace fs = std::filesystem;
using namespace unseen::vdtree;
namespace meshio = unseen::meshio;
namespace shapes = unseen::shapes;

void expect(const unseen::Result<void>& done) {
    if (!done) throw std::runtime_error(done.error().message);
}

void write(const fs::path& file, const std::string& bytes) {
    std::ofstream stream(file, std::ios::binary);
    stream << bytes;
    if (!stream) throw std::runtime_error("cannot write " + file.string());
}

// The first byte tells the target which reader is meant.
void write_for_reader(const fs::path& file, char reader, const fs::path& mesh) {
    std::ifstream stream(mesh, std::ios::binary);
    write(file, reader + std::string(std::istreambuf_iterator<char>(stream), {}));
}

void make_meshes(const fs::path& folder) {
    const Mesh mesh = shapes::with_attributes(shapes::icosphere(1));
    for (const auto& [ending, reader] : {std::pair(".ply", '\0'), std::pair(".obj", '\1'), std::pair(".glb", '\5'),
                                         std::pair(".vtp", '\6'), std::pair(".vtk", '\7')}) {
        const fs::path plain = folder / ("plain" + std::string(ending));
        expect(meshio::write_mesh(plain, mesh.view()));
        write_for_reader(folder / ("mesh" + std::string(ending)), reader, plain);
        fs::remove(plain);
    }
    const std::string text_ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float "
                                 "y\nproperty float z\nelement face 1\n"
                                 "property list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    write(folder / "text.ply", std::string(1, '\0') + text_ply);
    write(folder / "mesh.off", "\2OFF\n4 2 0\n0 0 0\n1 0 0\n0 1 0\n1 1 0\n3 0 1 2\n3 1 3 2\n");
    write(folder / "mesh.stl", "\3solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 "
                               "0\nendloop\nendfacet\nendsolid s\n");
    write(folder / "mesh.gltf",
          "\4{\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"byteLength\":36,\"uri\":\"data:application/"
          "octet-stream;base64,"
          "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA\"}],\"bufferViews\":[{\"buffer\":0,\"byteLength\":36}],"
          "\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":3,\"type\":\"VEC3\"}],"
          "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0}}]}],\"nodes\":[{\"mesh\":0}],\"scenes\":[{"
          "\"nodes\":[0]}]}");
}

void make_vtk(const fs::path& folder) {
    for (const auto& [name, bytes] : vtk_files::samples())
        write(folder / name, (name.ends_with(".vtp") ? '\6' : '\7') + bytes);
    // The statements of legacy files.
    write(folder / "statements.vtk",
          '\7' + vtk_files::vtk_quad(false, false,
                                     "METADATA\nCOMPONENT_NAMES\nx\n\n\n\nCELL_DATA 1\nSCALARS q float 1\n"
                                     "LOOKUP_TABLE t\n1\nLOOKUP_TABLE t 1\n0 0 0 1\nPOINT_DATA 4\nNORMALS n float\n"
                                     "0 0 1 0 0 1 0 0 1 0 0 1\nTEXTURE_COORDINATES t 2 float\n0 0 1 0 1 1 0 1\n"
                                     "COLOR_SCALARS c 1\n0 0 1 1\nFIELD f 3\nNULL_ARRAY\nw 1 2 string\na\nb\n"
                                     "b 1 4 bit\n0 1 1 0\n"));
    write(folder / "strings.vtk", '\7' + vtk_files::vtk_quad(true, true,
                                                             std::string("POINT_DATA 4\nFIELD f 2\nw 1 2 string\n\xC1"
                                                                         "a\x80\1b\nb 3 4 bit\nxy\n")));
}

Mesh with_values(Mesh mesh) {
    std::vector<std::byte> values(4 * mesh.positions.size());
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = static_cast<std::byte>(i * 31);
    const meshio::VertexArray numbers{.name = "n", .type = meshio::ValueType::int32, .values = values};
    const meshio::VertexArray reals{.name = "r", .type = meshio::ValueType::float32, .values = values};
    mesh.document = meshio::pack({.format = meshio::SourceDocument::Format::table, .arrays = {numbers, reals}});
    return mesh;
}

Mesh with_document(Mesh mesh) {
    mesh.ranges = {{"part", MeshRange::Kind::primitive, 0, mesh.triangles.size()}};
    const std::size_t vertices = mesh.positions.size();
    mesh.document = meshio::pack({.json = "{}",
                                  .files = {{.uri = "image.png"}},
                                  .parts = {{.node = 0, .mesh = 0, .primitive = 0, .channels = 1}},
                                  .runs = {{0, 0}},
                                  .channels = {{"TEXCOORD_0", 2, std::vector<float>(2 * vertices, 0.5f)}},
                                  .vertex_parts = std::vector<std::uint32_t>(vertices, 0)});
    return mesh;
}

void make_trees(const fs::path& folder) {
    const std::pair<const char*, Mesh> meshes[] = {{"ball", shapes::bumpy_sphere(1)},
                                                   {"open", shapes::grid(4)},
                                                   {"triangle", shapes::single_triangle()},
                                                   {"attributes", shapes::with_attributes(shapes::icosphere(1))},
                                                   {"document", with_document(shapes::icosphere(1))},
                                                   {"values", with_values(shapes::icosphere(1))}};
    for (const auto& [name, mesh] : meshes) {
        const auto tree = build_tree(mesh.view());
        if (!tree) throw std::runtime_error(tree.error().message);
        expect(write_tree(folder / (std::string(name) + ".vdt"), *tree));
        const auto marked = tree->with_attribute("mark", AttributeDomain::interior_node,
                                                 std::vector<float>(tree->interior_count(), 0.5f));
        if (!marked) throw std::runtime_error(marked.error().message);
        expect(write_tree(folder / (std::string(name) + "_marked.vdt"), *marked));
    }
}

void make_drives(const fs::path& folder) {
    std::mt19937 random(1);
    for (int i = 0; i < 8; ++i) {
        std::string bytes(256 << (i % 4), '\0');
        for (char& byte : bytes) byte = static_cast<char>(random());
        write(folder / std::to_string(i), bytes);
    }
}

} // namespace

int main(int count, char** arguments) try {
    if (count != 2) throw std::runtime_error("usage: make_fuzz_seeds FOLDER");
    const fs::path folder = arguments[1];
    for (const char* target : {"mesh", "tree", "follow"}) fs::create_directories(folder / target);
    make_meshes(folder / "mesh");
    make_vtk(folder / "mesh");
    make_trees(folder / "tree");
    make_drives(folder / "follow");
} catch (const std::exception& error) {
    std::fprintf(stderr, "make_fuzz_seeds: %s\n", error.what());
    return 1;
}
