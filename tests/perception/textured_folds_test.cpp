// What folds change of textures: what the measurement looks at, and what it finds.

#include <unseen/perception/criterion.h>
#include <unseen/perception/fold_measurement.h>
#include <unseen/perception/internal/lit_folds.h>
#include <unseen/vdtree/internal/texture_pyramid.h>
#include <unseen/vdtree/tree_io.h>

#include "built.h"
#include "measure/fold_record.h"
#include "measure/texture_detail.h"
#include "shapes.h"
#include "temp_folder.h"
#include "testing.h"
#include "textures.h"

namespace unseen::perception::textured_folds_test {

using namespace vdtree;

UvBox box(glm::vec2 a, glm::vec2 b) {
    UvBox box;
    box.include(a), box.include(b);
    return box;
}

TEST(TextureDetail, IsThatOfTheTexture) {
    const Texture texture = textures::checkerboard(128, 64, 16, 0, 255);
    const TextureDetail detail(texture.view());
    ASSERT_EQ(detail.level_count(), 8u);
    EXPECT_FLOAT_EQ(detail.at(0, {8.0f / 128, 8.0f / 64}), 0);
    EXPECT_FLOAT_EQ(detail.at(0, {24.0f / 128, 8.0f / 64}), 1);
    EXPECT_FLOAT_EQ(detail.at(0, {1 + 24.0f / 128, 8.0f / 64 - 3}), 1); // it repeats
    EXPECT_FLOAT_EQ(detail.nearest(0, {1 + 24.0f / 128, 8.0f / 64 - 3}), 1);
    EXPECT_NEAR(detail.at(7, {0.3f, 0.3f}), 0.5f, 1e-6f);
    EXPECT_EQ(detail.level_of(1), 0u);
    EXPECT_EQ(detail.level_of(1.1f), 1u);
    EXPECT_EQ(detail.level_of(1e9f), 7u);
    // Within a field nothing varies; its borders do.
    EXPECT_LT(detail.contrast(0, box({7.9f / 128, 7.9f / 64}, {8.1f / 128, 8.1f / 64})), 1e-6f);
    EXPECT_GT(detail.contrast(0, box({15.5f / 128, 7.9f / 64}, {16.5f / 128, 8.1f / 64})), 0.3f);
    EXPECT_GT(detail.contrast(4, box({0, 0}, {1, 1})), 0.3f);
    EXPECT_FLOAT_EQ(detail.contrast(7, box({0, 0}, {1, 1})), 0);
    // A box within another shows no more.
    for (const Wrap wrap : {Wrap::repeat, Wrap::clamp, Wrap::mirror}) {
        Texture wrapped = textures::noise(37, 21, 4);
        wrapped.wrap_u = wrapped.wrap_v = wrap;
        const TextureDetail of(wrapped.view());
        for (float x = -2; x < 2; x += 0.13f)
            for (std::size_t level = 0; level < of.level_count(); ++level)
                EXPECT_LE(of.contrast(level, box({x, 0.1f}, {x + 0.05f, 0.15f})),
                          of.contrast(level, box({x - 0.2f, -0.1f}, {x + 0.3f, 0.4f})));
    }
    // Coordinates that are none, or beyond all texels, lead nobody astray.
    const float far = 1e30f, none = std::numeric_limits<float>::quiet_NaN();
    for (const float bad : {far, -far, none}) {
        EXPECT_TRUE(std::isfinite(detail.at(0, {bad, 0})));
        EXPECT_TRUE(std::isfinite(detail.nearest(0, {bad, 0})));
        EXPECT_TRUE(std::isfinite(detail.contrast(0, box({bad, 0}, {bad, 1}))));
    }
}

TEST(TexturedLight, IsTheMeanOverTheTriangle) {
    const Texture texture = textures::checkerboard(64, 64, 8, 0, 255);
    const TextureDetail detail(texture.view());
    const TexturedLight light{&detail, 0.25f};
    EXPECT_NEAR(light.mean({0.75f, 0.75f, 0.75f}, {glm::vec2(0, 0), glm::vec2(2, 0), glm::vec2(0, 2)}), 0.5f, 0.02f);
    const glm::vec2 in_black(4.0f / 64, 4.0f / 64);
    EXPECT_FLOAT_EQ(light.mean({0.75f, 0.75f, 0.75f}, {in_black, in_black, in_black}), 0.25f);
}

VertexTree measured(const Mesh& mesh, bool prelit = true) {
    return std::move(*require(measure_folds(support::built(mesh, {.prelit = prelit}), 2)));
}

float largest_contrast(const VertexTree& tree) {
    float most = 0;
    for (const FoldTexture& t : tree.attribute<FoldTexture>(texture_name))
        most = std::max(most, *std::max_element(std::begin(t.contrast), std::end(t.contrast)));
    return most;
}

// On a plane an even texture slides nowhere, whatever it shows; squeezed to one side, it does.
TEST(TexturedFolds, SlideWhereTheTextureIsUneven) {
    const Texture texture = textures::checkerboard(512, 512, 4, 0, 255);
    Mesh even = textures::textured_grid(20, texture), squeezed = even;
    for (glm::vec2& uv : squeezed.uvs) uv.x = uv.x * uv.x;
    const VertexTree of_even = measured(even), of_squeezed = measured(squeezed);
    // Of pairs of vertices away from the border, where corners are cut.
    const auto inside = [](const VertexTree& tree) {
        float most = 0;
        const auto all = tree.attribute<FoldTexture>(texture_name);
        const SoundTree sound = *SoundTree::of(tree);
        for (NodeId node = 0; node < tree.interior_count(); ++node)
            if (sound.leaf_end()[node] - sound.first_leaf()[node] == 2 &&
                !(tree.bounds()[sound.parents()[node]].flags & irregular_ring))
                most = std::max(most, all[node].slide);
        return most;
    };
    EXPECT_LT(inside(of_even), 1e-3f);
    EXPECT_GT(inside(of_squeezed), 3e-3f);
    EXPECT_GT(largest_contrast(of_squeezed), 0.5f);
}

// A texture that is white everywhere changes nothing.
TEST(TexturedFolds, OfAWhiteTextureAreThoseOfTheMesh) {
    Mesh mesh = shapes::bumpy_sphere(4, 0.02);
    for (const glm::dvec3& p : mesh.positions) mesh.uvs.emplace_back(p.x, p.y);
    mesh.texture = textures::checkerboard(16, 16, 16, 255, 255);
    const VertexTree textured = measured(mesh, false), plain = *measure_folds(*textured.untextured(), 2);
    EXPECT_LT(largest_contrast(textured), 1e-5f);
    const auto before = plain.attribute<FoldRecord>(record_name), after = textured.attribute<FoldRecord>(record_name);
    ASSERT_EQ(before.size(), after.size());
    // Without colours or a texture, surfaces are a light grey.
    const float brighter = textured.luminance_range().hi / plain.luminance_range().hi;
    for (std::size_t i = 0; i < before.size(); ++i)
        for (std::size_t band = 0; band < measurement::picture_bands; ++band)
            EXPECT_NEAR(brighter * before[i].amplitudes[0][band], after[i].amplitudes[0][band], 1e-3f) << i;
}

TEST(TexturedFolds, StayInFiles) {
    const support::TempFolder folder;
    const VertexTree tree = measured(textures::textured_sphere(3, textures::noise(64, 64, 2)));
    ASSERT_TRUE(write_tree(folder / "tree.vdt", *require(LitFolds::measure(tree)->with_attributes(tree))));
    const auto read = require(read_tree(folder / "tree.vdt"));
    EXPECT_TRUE(has_fold_measurement(*read));
    EXPECT_TRUE(
        std::ranges::equal(read->attribute<FoldTexture>(texture_name), tree.attribute<FoldTexture>(texture_name)));
    EXPECT_TRUE(LitFolds::of(*read));
    vdtree::View view;
    view.eye = {0, 0, 5};
    EXPECT_TRUE(error_distances(*read, view, {}));
    // Damaged, they are refused.
    const auto whole = tree.attribute<FoldTexture>(texture_name);
    for (const float bad : {-1.0f, std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()})
        for (float FoldTexture::*member : {&FoldTexture::mean, &FoldTexture::slide}) {
            std::vector<FoldTexture> damaged(whole.begin(), whole.end());
            damaged[3].*member = bad;
            const auto lying = require(tree.with_attribute(texture_name, AttributeDomain::interior_node, damaged));
            EXPECT_FALSE(error_distances(*lying, view, {}));
        }
}

// A red and a cyan of one luminance: on red vertices one of them is black.
TEST(TexturedFolds, CountAsTheirVerticesTintThem) {
    Texture texture = textures::checkerboard(64, 64, 4, 0, 255);
    for (Texel& t : texture.texels) t = t[0] > 0 ? Texel{255, 0, 0, 255} : Texel{0, 139, 139, 255};
    const TextureDetail plain(texture.view()), red(texture.view(), glm::vec3(0.4f, 0, 0));
    const UvBox all = box({0, 0}, {1, 1});
    EXPECT_LT(plain.contrast(0, all), 0.1f);
    EXPECT_GT(red.contrast(0, all), 0.5f);
    Mesh mesh = textures::textured_sphere(3, texture);
    mesh.colours.assign(mesh.positions.size(), glm::vec4(0.4f, 0, 0, 1));
    mesh.colours[7] *= 0.5f; // darker, of the same hue
    mesh.colours[7].a = 1;
    EXPECT_TRUE(knows_texture(support::built(mesh)));
    EXPECT_GT(largest_contrast(measured(mesh)), 0.3f);
    mesh.colours[7] = glm::vec4(0, 0.4f, 0, 1);
    const VertexTree of_two = support::built(mesh);
    EXPECT_FALSE(knows_texture(of_two));
    EXPECT_TRUE(knows_texture(*of_two.untextured()));
    const auto refused = measure_folds(of_two);
    ASSERT_FALSE(refused);
    EXPECT_NE(refused.error().message.find("several hues"), std::string::npos) << refused.error().message;
    EXPECT_FALSE(LitFolds::measure(of_two));
}

TEST(TexturedFolds, DoNotDependOnTheThreads) {
    const VertexTree tree =
        support::built(textures::with_seams(textures::textured_sphere(4, textures::noise(64, 64, 2))));
    const auto one = require(measure_folds(tree, 1)), four = require(measure_folds(tree, 4));
    EXPECT_TRUE(std::ranges::equal(one->attribute<FoldRecord>(record_name), four->attribute<FoldRecord>(record_name)));
    EXPECT_TRUE(
        std::ranges::equal(one->attribute<FoldTexture>(texture_name), four->attribute<FoldTexture>(texture_name)));
}

// Whatever a mesh is like, what is measured of it are numbers.
TEST(TexturedFolds, OfOddMeshesAreNumbers) {
    const Texture texture = textures::noise(16, 8, 7);
    Mesh constant = textures::textured_sphere(2, texture); // one texel everywhere
    for (glm::vec2& uv : constant.uvs) uv = glm::vec2(0.5f);
    Mesh far = textures::textured_sphere(2, texture); // no texels of their own
    for (glm::vec2& uv : far.uvs) uv *= 1e9f;
    Mesh dot = textures::textured_sphere(2, textures::checkerboard(1, 1, 1, 9, 9));
    for (const Mesh& mesh :
         {constant, far, dot, textures::textured_cases(4), textures::with_uvs(shapes::seam(false), texture)}) {
        const auto tree = require(measure_folds(support::built(mesh), 1));
        for (const FoldTexture& t : tree->attribute<FoldTexture>(texture_name)) EXPECT_TRUE(is_sound(t));
        vdtree::View view;
        view.eye = {0, 0, 9};
        EXPECT_TRUE(require(error_distances(*tree, view, {}))->is_monotone());
    }
}

} // namespace unseen::perception::textured_folds_test
