// Textures: what pyramids say of them against every texel, and what trees with textures promise.
#include <unseen/vdtree/mesh.h>

#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/cut.h>
#include <unseen/vdtree/internal/conserve_light.h>
#include <unseen/vdtree/internal/texture_pyramid.h>
#include <unseen/vdtree/tree_io.h>

#include "built.h"
#include "shapes.h"
#include "sound.h"
#include "temp_folder.h"
#include "testing.h"
#include "textures.h"
#include "tree_file.h"

namespace unseen::vdtree::texture_test {

using support::built;

// What filters on graphics processors do, in double.
double bilinear(const Texture& texture, double u, double v) {
    const double x = u * texture.width - 0.5, y = v * texture.height - 0.5;
    const auto wrapped = [](double i, std::uint32_t n, Wrap wrap) {
        const double size = n;
        if (wrap == Wrap::clamp) return static_cast<std::size_t>(std::clamp(i, 0.0, size - 1));
        const double copy = std::floor(i / size), along = i - size * copy;
        const bool is_mirrored = wrap == Wrap::mirror && std::fmod(copy, 2) != 0;
        return static_cast<std::size_t>(is_mirrored ? size - 1 - along : along);
    };
    const auto at = [&](double i, double j) {
        return linear_luminance(texture.texels[wrapped(j, texture.height, texture.wrap_v) * texture.width +
                                               wrapped(i, texture.width, texture.wrap_u)]);
    };
    const double i = std::floor(x), j = std::floor(y), s = x - i, t = y - j;
    return (1 - t) * ((1 - s) * at(i, j) + s * at(i + 1, j)) + t * ((1 - s) * at(i, j + 1) + s * at(i + 1, j + 1));
}

TEST(TexturePyramid, HoldsWhatFilteringReturns) {
    std::mt19937_64 random(3);
    int tight = 0, looked = 0;
    for (const auto& [width, height] :
         {std::pair(64u, 64u), std::pair(37u, 19u), std::pair(1u, 1u), std::pair(100u, 3u)}) {
        for (const Wrap wrap : {Wrap::repeat, Wrap::clamp, Wrap::mirror}) {
            Texture texture = textures::noise(width, height, 7);
            texture.wrap_u = wrap;
            const TexturePyramid pyramid(texture.view());
            for (int trial = 0; trial < 300; ++trial) {
                const double size = std::exp2(shapes::random_between(random, -8, 1));
                const glm::vec2 lo(shapes::random_between(random, -2, 2), shapes::random_between(random, -2, 2));
                const glm::vec2 hi =
                    lo + glm::vec2(size * shapes::random_unit(random), size * shapes::random_unit(random));
                const PackedRange range = pyramid.range({lo, hi});
                double least = 1, most = 0;
                for (int k = 0; k < 40; ++k) {
                    const double u = shapes::random_between(random, lo.x, hi.x),
                                 v = shapes::random_between(random, lo.y, hi.y);
                    const double y = bilinear(texture, u, v);
                    EXPECT_LE(range.lo, y);
                    EXPECT_GE(range.hi, y);
                    least = std::min(least, y), most = std::max(most, y);
                }
                // Nothing that is not near: a seventh of the longer side, and the texel that filters reach for.
                if (wrap != Wrap::clamp) {
                    const float w = static_cast<float>(width), h = static_cast<float>(height),
                                longer = std::max((hi.x - lo.x) * w, (hi.y - lo.y) * h);
                    const glm::vec2 around((longer / 7 + 2) / w, (longer / 7 + 2) / h);
                    const auto is_within = [](double at, double period, float first, float last) {
                        return at - period * std::floor((at - static_cast<double>(first)) / period) <=
                               static_cast<double>(last);
                    };
                    const auto lies_near = [&](double at, float first, float last, Wrap along) {
                        if (along != Wrap::mirror) return is_within(at, 1, first, last);
                        return is_within(at, 2, first, last) || is_within(-at, 2, first, last);
                    };
                    double least_near = 1, most_near = 0;
                    for (std::uint32_t y = 0; y < height; ++y)
                        for (std::uint32_t x = 0; x < width; ++x) {
                            if (!lies_near((x + 0.5) / width, lo.x - around.x, hi.x + around.x, wrap) ||
                                !lies_near((y + 0.5) / height, lo.y - around.y, hi.y + around.y, Wrap::repeat))
                                continue;
                            const double luminance = linear_luminance(texture.texels[y * width + x]);
                            least_near = std::min(least_near, luminance), most_near = std::max(most_near, luminance);
                        }
                    EXPECT_GE(range.lo, least_near - 1e-3);
                    EXPECT_LE(range.hi, most_near + 1e-3);
                }
                ++looked;
                tight += range.lo >= least - 0.1 && range.hi <= most + 0.1;
            }
        }
    }
    EXPECT_GT(tight, looked / 4); // it is not just everything
}

TEST(TexturePyramid, OfABoxWithinAnotherLiesWithinTheOthers) {
    std::mt19937_64 random(4);
    Texture texture = textures::noise(90, 70, 2);
    texture.wrap_v = Wrap::mirror;
    const TexturePyramid pyramid(texture.view());
    for (int trial = 0; trial < 5000; ++trial) {
        UvBox inner, outer;
        for (int k = 0; k < 2; ++k) {
            const double size = std::exp2(shapes::random_between(random, -7, 1));
            inner.include(
                glm::vec2(size * shapes::random_between(random, -2, 2), size * shapes::random_between(random, -2, 2)));
            outer.include(
                glm::vec2(size * shapes::random_between(random, -2, 2), size * shapes::random_between(random, -2, 2)));
        }
        outer.include(inner);
        const auto a = pyramid.range(inner), b = pyramid.range(outer);
        EXPECT_LE(b.lo, a.lo);
        EXPECT_GE(b.hi, a.hi);
    }
}

TEST(TexturePyramid, TakesCoordinatesThatAreNowhere) {
    const Texture texture = textures::checkerboard(16, 16, 4, 0, 255);
    const TexturePyramid pyramid(texture.view());
    const float far = 3e38f;
    for (const UvBox& box : {UvBox{{-far, -far}, {far, far}}, UvBox{{far, far}, {far, far}}, UvBox{}}) {
        EXPECT_EQ(pyramid.range(box).lo, Unorm16{0});
        EXPECT_EQ(pyramid.range(box).hi, Unorm16{Unorm16::largest});
    }
    EXPECT_NEAR(pyramid.mean({1e30, 0}, 1), 0.5, 0.01);
    EXPECT_NEAR(pyramid.mean({0.3, 0.7}, 8), 0.5, 0.01);
    EXPECT_NEAR(pyramid.mean({2.0 / 16, 2.0 / 16}, 0), 0, 0.01);
}

TEST(Textures, AreCheckedBeforeTheyAreLaid) {
    Mesh mesh = textures::textured_grid(3, textures::checkerboard(8, 8, 2, 0, 255));
    const auto complaint = [](const Mesh& m) {
        const auto tree = build_tree(m.view());
        return tree ? "" : tree.error().message;
    };
    EXPECT_EQ(complaint(mesh), "");
    Mesh bad = mesh;
    bad.texture.texels.pop_back();
    EXPECT_NE(complaint(bad).find("8 x 8 texels holds 63"), std::string::npos) << complaint(bad);
    bad = mesh;
    bad.texture.width = 0;
    EXPECT_NE(complaint(bad).find("empty"), std::string::npos);
    bad = mesh;
    bad.texture.width = 100000;
    EXPECT_NE(complaint(bad).find("scale it down"), std::string::npos);
    bad = mesh;
    bad.texture.relief.resize(63);
    EXPECT_NE(complaint(bad).find("A map over the texture of 8 x 8 texels holds 63"), std::string::npos)
        << complaint(bad);
    bad = mesh;
    bad.uvs.clear();
    EXPECT_NE(complaint(bad).find("no UVs"), std::string::npos);
    bad = mesh;
    bad.uvs[2].y = std::nanf("");
    EXPECT_NE(complaint(bad).find("texture coordinates of vertex 2"), std::string::npos) << complaint(bad);
    bad = mesh;
    bad.colours.assign(mesh.positions.size(), glm::vec4(1));
    bad.colours[4].g = 1.5f;
    EXPECT_NE(complaint(bad).find("of vertex 4"), std::string::npos) << complaint(bad);
}

TEST(Textures, BoundTheRingsOfAllMeshes) {
    for (int which = 0; which < 5; ++which) {
        for (const ClustererKind clusterer : {ClustererKind::quadric, ClustererKind::octree}) {
            const VertexTree tree = built(textures::textured_cases(which), {.clusterer = clusterer, .prelit = true});
            const auto sound = verify(tree);
            EXPECT_TRUE(sound) << which << ": " << sound.error().message;
            EXPECT_TRUE(tree.is_prelit());
            EXPECT_EQ(tree.ring_texture().size(), tree.interior_count());
            const auto relit = require(tree.relit({.direction = {0, 0, 1}, .ambient = 0.1f}));
            EXPECT_TRUE(verify(*relit)) << verify(*relit).error().message;
        }
    }
}

TEST(Textures, AreKeptInFiles) {
    const support::TempFolder folder;
    const std::filesystem::path file = folder.path() / "t.vdt";
    Mesh mesh = textures::with_seams(textures::textured_sphere(3, textures::noise(33, 20, 8)));
    mesh.texture.wrap_v = Wrap::clamp;
    mesh.texture.blends = true;
    mesh.texture.emission = textures::noise(33, 20, 4).texels;
    mesh.texture.relief = textures::noise(33, 20, 2).texels;
    const VertexTree tree = built(mesh, {.prelit = true});
    ASSERT_TRUE(write_tree(file, tree));
    for (const bool mapped : {false, true}) {
        const auto again = require(mapped ? map_tree(file) : read_tree(file));
        EXPECT_TRUE(again->is_prelit());
        const TextureView texture = again->texture();
        EXPECT_EQ(texture.width, 33u);
        EXPECT_EQ(texture.height, 20u);
        EXPECT_EQ(texture.wrap_u, Wrap::repeat);
        EXPECT_EQ(texture.wrap_v, Wrap::clamp);
        EXPECT_TRUE(std::equal(texture.texels.begin(), texture.texels.end(), mesh.texture.texels.begin(),
                               mesh.texture.texels.end()));
        EXPECT_TRUE(texture.blends);
        EXPECT_TRUE(std::ranges::equal(texture.emission, mesh.texture.emission));
        EXPECT_TRUE(std::ranges::equal(texture.relief, mesh.texture.relief));
        EXPECT_TRUE(std::equal(again->ring_texture().begin(), again->ring_texture().end(), tree.ring_texture().begin(),
                               tree.ring_texture().end()));
        EXPECT_TRUE(verify(*again));
    }
    // Without it, the file is that of a mesh without texture.
    const auto plain = require(tree.untextured());
    ASSERT_TRUE(write_tree(file, *plain));
    const auto again = require(read_tree(file));
    EXPECT_TRUE(again->texture().empty());
    EXPECT_FALSE(again->is_prelit());
    EXPECT_TRUE(verify(*again)) << verify(*again).error().message;
    EXPECT_FLOAT_EQ(again->luminance_range().hi, plain->luminance_range().hi);
}

TEST(Textures, OfDamagedFilesAreRefused) {
    const support::TempFolder folder;
    const std::filesystem::path file = folder.path() / "t.vdt";
    Mesh mesh = textures::textured_sphere(2, textures::noise(8, 8, 8));
    mesh.texture.emission = mesh.texture.relief = mesh.texture.texels;
    ASSERT_TRUE(write_tree(file, built(mesh)));
    const std::string whole = support::read_bytes(file);
    const auto complaint = [&](auto&& damage) {
        support::TreeFile parts = support::TreeFile::parse(whole);
        damage(parts);
        std::ofstream(file, std::ios::binary) << parts.bytes();
        std::string all;
        for (const bool mapped : {false, true}) {
            const auto tree = mapped ? map_tree(file) : read_tree(file);
            all += tree ? "none;" : tree.error().message + ";";
        }
        return all;
    };
    using Parts = support::TreeFile;
    EXPECT_EQ(complaint([](Parts&) {}), "none;none;");
    const auto expect = [&](const char* words, int times, auto&& damage) {
        const std::string found = complaint(damage);
        int count = 0;
        for (std::size_t at = found.find(words); at != std::string::npos; at = found.find(words, at + 1)) ++count;
        EXPECT_EQ(count, times) << found;
    };
    for (const std::uint32_t width : {0u, 7u, 9u, 0xffffffffu})
        expect("texture", 2, [&](Parts& p) { p["texture"].set<std::uint32_t>(0, width); });
    expect("repeats", 2, [](Parts& p) { p["texture"].set<std::uint32_t>(2, 5u); });
    expect("texels", 2, [](Parts& p) { p["texels"].data.resize(4 * 63); });
    for (const char* map : {"emission", "relief"})
        expect("A map over", 2, [&](Parts& p) { p[map].data.resize(4 * 63); });
    expect("texture", 2, [](Parts& p) { p["texture"].data += p["texture"].data; });
    expect("texture", 2, [](Parts& p) { p["uvs"].data.clear(); });
    expect("ring_texture", 2, [](Parts& p) { p["ring_texture"].data.resize(4); });
    expect("ends before it begins", 1,
           [](Parts& p) { // not looked at where it is mapped: it can only draw another picture
               p["ring_texture"].set<std::uint16_t>(0, 60000);
               p["ring_texture"].set<std::uint16_t>(1, 1);
           });
    for (const char* name : {"texture", "texels", "ring_texture"})
        expect("Section", 2,
               [&](Parts& p) { std::erase_if(p.sections, [&](const auto& s) { return s.name == name; }); });
}

// Equal vertices are one leaf; those of a seam are two, which stay apart in every node.
TEST(Textures, StayAtTheirSeams) {
    Mesh mesh = textures::textured_grid(8, textures::checkerboard(32, 32, 16, 0, 255));
    Mesh unwelded = shapes::unwelded(mesh);
    unwelded.texture = mesh.texture;
    const VertexTree split = built(unwelded, {.prelit = true}),
                     seamed = built(textures::with_seams(mesh, 4), {.prelit = true});
    EXPECT_FALSE(split.has_seams());
    EXPECT_TRUE(seamed.has_seams());
    // Sides of a seam are told by their coordinates: no triangle of any cut has corners of two charts.
    Cut cut(seamed);
    cut.unfold_all();
    for (NodeId node = seamed.interior_count(); node-- > 0; cut.fold(node)) {
        const auto indices = cut.indices();
        for (std::size_t i = 0; i < indices.size(); i += 3)
            for (std::size_t k = 1; k < 3; ++k)
                ASSERT_LT(glm::distance(seamed.uvs()[indices[i]], seamed.uvs()[indices[i + k]]), 1.5f)
                    << "node " << node;
    }
}

TEST(Textures, SendOutLightThatIsNotConserved) {
    const VertexTree tree = built(textures::textured_grid(4, textures::checkerboard(8, 8, 2, 0, 255)));
    const auto conserved = conserve_light(tree);
    ASSERT_FALSE(conserved);
    EXPECT_NE(conserved.error().message.find("texture"), std::string::npos);
    EXPECT_TRUE(conserve_light(*tree.untextured()));
}

} // namespace unseen::vdtree::texture_test
