// What goes with a tree besides triangles: as bytes and back, and bytes that lie.

#include <unseen/meshio/mesh_file.h>
#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/cut.h>
#include <unseen/vdtree/tree_io.h>

#include "gltf_scene.h"
#include "temp_folder.h"
#include "testing.h"

namespace unseen::vdtree::source_document_test {

using meshio::SourceDocument;
using support::GltfScene;

const std::array<std::string, 3> images = {"\x89PNG one", "\x89PNG two", "\xFF\xD8\xFF three"};

// Of a triangle of the mesh.
std::uint32_t part_of(const SourceDocument& document, std::uint64_t triangle) {
    const auto after = std::ranges::upper_bound(document.runs, triangle, {}, &SourceDocument::Run::first_triangle);
    return (after - 1)->part;
}

// The scene as it is read, with what materials laid over it would be.
meshio::ReadResult read_scene(const support::TempFolder& folder, meshio::ReadOptions options = {}) {
    support::write_bytes(folder / "in.glb", GltfScene(6, 8).glb(images));
    auto read = require(meshio::read_mesh(folder / "in.glb", options));
    SourceDocument& document = *read->document;
    document.vertex_parts.assign(read->mesh.positions.size(), 0);
    for (std::size_t t = 0; t < read->mesh.triangles.size(); ++t)
        for (const Index v : read->mesh.triangles[t]) document.vertex_parts[v] = part_of(document, t);
    read->mesh.further = meshio::further_values(document);
    return std::move(*read);
}

VertexTree tree_with(Mesh mesh, std::vector<std::byte> document) {
    mesh.document = std::move(document);
    return std::move(*require(build_tree(mesh.view())));
}

Cut full_cut(const VertexTree& tree) {
    Cut cut(tree);
    cut.unfold_all();
    return cut;
}

TEST(SourceDocuments, ComeBackFromBytes) {
    const support::TempFolder folder;
    const SourceDocument document = *read_scene(folder).document;
    ASSERT_EQ(document.parts.size(), 2u);
    ASSERT_EQ(document.files.size(), 3u);
    ASSERT_EQ(document.channels.size(), 4u);
    const auto bytes = meshio::pack(document);
    const auto again = require(meshio::unpack(bytes));
    EXPECT_EQ(meshio::pack(*again), bytes);
    EXPECT_EQ(again->json, document.json);
    EXPECT_EQ(*again->files[2].bytes, images[2]);
    EXPECT_EQ(again->parts[1].to_world, document.parts[1].to_world);
    EXPECT_EQ(again->channels[3].values, document.channels[3].values);
    EXPECT_EQ(part_of(*again, 0), 0u);
    EXPECT_EQ(part_of(*again, read_scene(folder).mesh.triangles.size() - 1), 1u);
}

TEST(SourceDocuments, GoWithTreesToFilesAndBack) {
    const support::TempFolder folder;
    meshio::ReadResult read = read_scene(folder);
    const auto bytes = meshio::pack(*read.document);
    const VertexTree tree = tree_with(std::move(read.mesh), bytes);
    ASSERT_TRUE(write_tree(folder / "t.vdt", tree));
    for (const auto& opened : {read_tree(folder / "t.vdt"), map_tree(folder / "t.vdt")}) {
        ASSERT_TRUE(opened) << opened.error().message;
        EXPECT_TRUE(std::ranges::equal(opened->document(), bytes));
        const auto relit = require(opened->relit({}));
        EXPECT_EQ(relit->document().size(), bytes.size()) << "another light changes nothing of it";
        ASSERT_TRUE(meshio::write_cut(folder / "out.glb", full_cut(*opened)));
        const auto in = support::read_gltf(folder / "in.glb"), out = support::read_gltf(folder / "out.glb");
        EXPECT_EQ(in.rest, out.rest);
        EXPECT_EQ(in.images, out.images);
        EXPECT_TRUE(in.triangles == out.triangles);
    }
}

TEST(SourceDocuments, KnowWhichVerticesHaveTheSameValues) {
    SourceDocument document{.format = SourceDocument::Format::obj, .parts = {{.channels = 1}, {.channels = 3}}};
    document.channels = {{"NORMAL", 3, {0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 1, 0}},
                         {"TEXCOORD_1", 2, std::vector<float>(10)}};
    document.vertex_parts = {0, 1, 0, 1, 0};
    EXPECT_THAT(meshio::further_values(document), ElementsAre(0, 1, 0, 1, 4)) << "vertices 0 and 2 lack the second";
    document.channels[1].values[7] = 0.5f;
    EXPECT_THAT(meshio::further_values(document), ElementsAre(0, 1, 0, 3, 4));
    document.channels.clear();
    EXPECT_THAT(meshio::further_values(document), IsEmpty());
}

TEST(SourceDocuments, OfTrianglesThatAreDroppedStayInStep) {
    const support::TempFolder folder;
    GltfScene scene(6, 8);
    // The first triangle of the first mesh uses a vertex twice.
    const std::size_t view = scene.document["accessors"][4]["bufferView"];
    const std::size_t at = scene.document["bufferViews"][view]["byteOffset"];
    scene.data.replace(at, 4, scene.data.substr(at + 4, 4));
    support::write_bytes(folder / "in.glb", scene.glb(images));
    const auto read = require(meshio::read_mesh(folder / "in.glb"));
    ASSERT_EQ(read->dropped_triangles, 1u);
    const std::size_t first = scene.document["accessors"][4]["count"].get<std::size_t>() / 3;
    EXPECT_EQ(part_of(*read->document, first - 2), 0u);
    EXPECT_EQ(part_of(*read->document, first - 1), 1u);
}

// Whatever the bytes are, there is an error or a file, and nothing is read beyond their end.
TEST(SourceDocuments, OfDamagedBytesLeadNobodyAstray) {
    const support::TempFolder folder;
    meshio::ReadResult read = read_scene(folder);
    const auto good = meshio::pack(*read.document);
    for (std::size_t size = 0; size < good.size(); size += size < 4096 ? 1 : 97) {
        // In memory of its own, so that sanitizers see its end.
        const std::vector<std::byte> cut_short(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(size));
        EXPECT_FALSE(meshio::unpack(cut_short)) << size;
    }
    std::vector<std::byte> longer = good;
    longer.push_back(std::byte{0});
    EXPECT_FALSE(meshio::unpack(longer));

    std::mt19937 random(1);
    int refused = 0, written = 0;
    for (int i = 0; i < 1500; ++i) {
        std::vector<std::byte> bytes = good;
        // Where the structure is, and anywhere.
        const std::size_t end = i % 2 ? bytes.size() : std::size_t{4096};
        for (int k = 0; k < 1 + i % 3; ++k) bytes[random() % end] = static_cast<std::byte>(random());
        const auto document = meshio::unpack(bytes);
        refused += !document;
        if (!document || i % 30 != 0) continue;
        const VertexTree tree = tree_with(read.mesh, bytes);
        for (const char* name : {"x.glb", "x.gltf", "x.obj", "x.ply"}) {
            const support::TempFolder own;
            const auto out = meshio::write_cut(own / name, full_cut(tree));
            written += out.has_value();
            if (!out) EXPECT_FALSE(out.error().message.empty());
        }
    }
    EXPECT_GT(refused, 100);
    EXPECT_GT(written, 10);
}

// KHR_texture_transform: scaled first, then turned, u to v where positive, with v downward.
TEST(SourceDocuments, TransformsOfTexturesAreRead) {
    const support::TempFolder folder;
    GltfScene scene(6, 8);
    scene.document["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["extensions"]["KHR_texture_transform"] =
        {{"scale", {2, 4}}, {"rotation", std::numbers::pi / 2}, {"offset", {0.25, 0.5}}};
    support::write_bytes(folder / "in.glb", scene.glb(images));
    const auto read = require(meshio::read_mesh(folder / "in.glb"));
    const glm::dvec2 at = read->materials[0].uv_map(glm::dvec2(0.5, 0.125));
    EXPECT_NEAR(at.x, 0.25 + 0.5, 1e-12);
    EXPECT_NEAR(at.y, 0.5 - 1, 1e-12);
}

TEST(SourceDocuments, MustBeThatOfTheirTree) {
    const support::TempFolder folder;
    meshio::ReadResult read = read_scene(folder);
    SourceDocument fewer = *read.document;
    fewer.vertex_parts.resize(8);
    for (auto& channel : fewer.channels) channel.values.resize(8 * channel.components);
    const VertexTree tree = tree_with(read.mesh, meshio::pack(fewer));
    const auto out = meshio::write_cut(folder / "out.glb", full_cut(tree));
    ASSERT_FALSE(out);
    EXPECT_THAT(out.error().message, HasSubstr("not that of the tree's mesh"));
    SourceDocument hostile = *read.document;
    hostile.files[0].uri = "../../escaped.png";
    hostile.files[1].uri = ".profile";
    hostile.files[2].uri = "run.sh";
    std::filesystem::create_directories(folder / "a/b");
    ASSERT_TRUE(meshio::write_cut(folder / "a/b/out.glb", full_cut(tree_with(read.mesh, meshio::pack(hostile)))));
    EXPECT_FALSE(std::filesystem::exists(folder / "escaped.png"));
    EXPECT_FALSE(std::filesystem::exists(folder / "a/b/.profile"));
    EXPECT_FALSE(std::filesystem::exists(folder / "a/b/run.sh"));
}

} // namespace unseen::vdtree::source_document_test
