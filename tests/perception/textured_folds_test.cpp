// What folds change of textures: what the measurement looks at, and what it finds.

#include <unseen/perception/criterion.h>
#include <unseen/perception/fold_measurement.h>
#include <unseen/perception/internal/chroma.h>
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

// The largest value over pairs of vertices away from the border: at the border, corners are cut.
template <class F>
float largest_inside(const VertexTree& tree, const F& value) {
    float most = 0;
    const auto all = tree.attribute<FoldTexture>(texture_name);
    const SoundTree sound = *SoundTree::of(tree);
    for (NodeId node = 0; node < tree.interior_count(); ++node)
        if (sound.leaf_end()[node] - sound.first_leaf()[node] == 2 &&
            !(tree.bounds()[sound.parents()[node]].flags & irregular_ring))
            most = std::max(most, value(all[node]));
    return most;
}

// Half of a square is tilted towards the light by a normal map, half away from it; a quarter shines.
TEST(ShownTexels, AreThoseThatPicturesShow) {
    Texture texture{8, 8, Wrap::clamp, Wrap::clamp, std::vector<Texel>(64, Texel{188, 188, 188, 255})};
    for (std::size_t i = 0; i < 64; ++i) {
        texture.relief.push_back({static_cast<std::uint8_t>(i % 8 < 4 ? 204 : 52), 128, 230, 255}); // x = .6 or -.6
        texture.emission.push_back(i < 16 ? Texel{128, 0, 0, 255} : Texel{0, 0, 0, 255});
    }
    const Light light{.direction = {0.6f, 0, 0.8f}, .ambient = 0.2f, .fill = 0.25f};
    const VertexTree tree = support::built(textures::textured_grid(4, texture), {.light = light});
    const ShownTexels shown(tree);
    const double own = linear_luminance(texture.texels[0]), shade = 0.2 + 0.8 * 0.8;
    const double towards = 0.2 + 0.8 * 1.0, away = 0.2 + 0.8 * (0.8 * 0.8 - 0.6 * 0.6);
    constexpr double rounding = 0.01; // of the map's codes
    EXPECT_NEAR(shade * shown.luminance(35), own * towards, rounding);
    EXPECT_NEAR(shade * shown.luminance(38), own * away, rounding);
    EXPECT_NEAR(shade * static_cast<double>(shown.colour(3).r - shown.colour(3).g),
                static_cast<double>(linear_colour(texture.emission[0]).r), rounding);
    EXPECT_TRUE(has_colours(tree));
    EXPECT_FALSE(shown.are_alike());
    // Colours that are pre-lit have their light.
    EXPECT_NEAR(ShownTexels(support::built(textures::textured_grid(4, texture), {.prelit = true})).luminance(38), own,
                1e-6);
}

// An even colour shows what a normal map shades it by, and what it slides by is seen.
TEST(TexturedFolds, CountTheirMapsOfNormalsAndLight) {
    Mesh mesh = textures::textured_grid(20, textures::checkerboard(512, 512, 4, 128, 128));
    for (glm::vec2& uv : mesh.uvs) uv.x = uv.x * uv.x;
    Mesh bumpy = mesh, shining = mesh;
    const std::vector<Texel> board = textures::checkerboard(512, 512, 4, 40, 216).texels;
    for (const Texel& texel : board) bumpy.texture.relief.push_back({texel[0], 128, 220, 255});
    shining.texture.emission = board;
    const auto even = measured(mesh, false);
    for (const Mesh* m : {&bumpy, &shining}) {
        const VertexTree tree = measured(*m, false);
        EXPECT_GT(largest_contrast(tree), 0.2f);
        // Not the noise that stands in for images that are not known.
        EXPECT_NE(largest_contrast(tree), largest_contrast(even));
    }
}

// Under lights, too, where trees are shaded anew.
TEST(TexturedFolds, CountTheirNormalMapsUnderLights) {
    Mesh mesh = textures::textured_grid(20, textures::checkerboard(512, 512, 4, 128, 129));
    for (glm::vec2& uv : mesh.uvs) uv.x = uv.x * uv.x;
    const auto contrast_of = [](const Mesh& m) {
        const VertexTree tree = support::built(m);
        const VertexTree lit = *require(require(LitFolds::measure(tree))->with_attributes(tree));
        float most = 0;
        for (const FoldTexture& t : lit.attribute<FoldTexture>("lit_texture"))
            most = std::max(most, *std::max_element(std::begin(t.contrast), std::end(t.contrast)));
        return most;
    };
    const float even = contrast_of(mesh);
    for (const Texel& texel : textures::checkerboard(512, 512, 4, 40, 216).texels)
        mesh.texture.relief.push_back({texel[0], 128, 220, 255});
    EXPECT_GT(contrast_of(mesh), 5 * even);
}

// What shines is as bright as it shines, also in the ranges that outlines are held against.
TEST(TexturedFolds, RangesHoldWhatShines) {
    Mesh mesh = textures::textured_grid(4, textures::checkerboard(8, 8, 4, 60, 60));
    const VertexTree dark = support::built(mesh);
    mesh.texture.emission.assign(64, Texel{0, 0, 0, 255});
    for (std::size_t i = 0; i < 32; ++i) mesh.texture.emission[i] = {240, 240, 240, 255};
    const VertexTree tree = support::built(mesh);
    const auto light = static_cast<float>(linear_luminance({240, 240, 240, 255}));
    EXPECT_NEAR(tree.luminance_range().hi, dark.luminance_range().hi + light, 1e-3f);
    EXPECT_NEAR(tree.luminance_range().lo, dark.luminance_range().lo, 1e-3f);
    EXPECT_TRUE(verify(tree)) << verify(tree).error().message;
    mesh.texture.emission.assign(64, Texel{240, 240, 240, 255});
    EXPECT_NEAR(support::built(mesh).luminance_range().lo, dark.luminance_range().lo + light, 1e-3f);
}

// Coordinates beyond all texels, of maps that triangles are looked at for.
TEST(ShownTexels, TakeCoordinatesThatAreNowhere) {
    Mesh mesh = textures::textured_grid(4, textures::checkerboard(8, 8, 4, 60, 60));
    mesh.texture.relief = mesh.texture.emission = mesh.texture.texels;
    for (const float far : {1e37f, -1e20f, 3e6f}) {
        mesh.uvs[3] = {0, far};
        const ShownTexels shown(support::built(mesh));
        EXPECT_TRUE(std::isfinite(shown.luminance(0)));
    }
}

// On a plane an even texture slides nowhere, whatever it shows; squeezed to one side, it does.
TEST(TexturedFolds, SlideWhereTheTextureIsUneven) {
    const Texture texture = textures::checkerboard(512, 512, 4, 0, 255);
    Mesh even = textures::textured_grid(20, texture), squeezed = even;
    for (glm::vec2& uv : squeezed.uvs) uv.x = uv.x * uv.x;
    const VertexTree of_even = measured(even), of_squeezed = measured(squeezed);
    const auto slide = [](const FoldTexture& t) { return t.slide; };
    EXPECT_LT(largest_inside(of_even, slide), 1e-3f);
    EXPECT_GT(largest_inside(of_squeezed, slide), 3e-3f);
    EXPECT_GT(largest_contrast(of_squeezed), 0.5f);
}

// A texture that shows white everywhere changes nothing.
TEST(TexturedFolds, OfAWhiteTextureAreThoseOfTheMesh) {
    Mesh mesh = shapes::bumpy_sphere(4, 0.02);
    mesh.uvs.assign(mesh.positions.size(), glm::vec2(0.25f)); // in a white field
    mesh.texture = textures::checkerboard(16, 16, 8, 255, 0);
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
    const VertexTree tree = measured(textures::textured_sphere(2, textures::noise(64, 64, 2)));
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
    EXPECT_TRUE(knows_lit_texture(support::built(mesh)));
    EXPECT_GT(largest_contrast(measured(mesh)), 0.3f);
    mesh.colours[7] = glm::vec4(0, 0.4f, 0, 1);
    const VertexTree of_two = support::built(mesh);
    EXPECT_FALSE(knows_lit_texture(of_two));
    EXPECT_TRUE(knows_lit_texture(*of_two.untextured()));
    EXPECT_TRUE(measure_folds(of_two)); // by its primaries
    const auto refused = LitFolds::measure(of_two);
    ASSERT_FALSE(refused);
    EXPECT_NE(refused.error().message.find("several hues"), std::string::npos) << refused.error().message;
}

// The same two on white vertices differ in colour alone.
TEST(TexturedFolds, CountTheirColours) {
    Texture texture = textures::checkerboard(64, 64, 4, 0, 255), grey = texture;
    for (Texel& t : texture.texels) t = t[0] > 0 ? Texel{255, 0, 0, 255} : Texel{0, 139, 139, 255};
    for (Texel& t : grey.texels) t = t[0] > 0 ? Texel{127, 127, 127, 255} : Texel{128, 128, 128, 255};
    const VertexTree coloured = measured(textures::textured_sphere(3, texture)),
                     plain = measured(textures::textured_sphere(3, grey));
    EXPECT_TRUE(has_colours(coloured));
    EXPECT_FALSE(has_colours(plain)); // a code is less than compression makes of greys
    EXPECT_GT(largest_contrast(coloured), 5 * largest_contrast(plain));
    const auto amplitudes = [](const VertexTree& tree) {
        double sum = 0;
        for (const FoldRecord& record : tree.attribute<FoldRecord>(record_name))
            sum += static_cast<double>(record.amplitudes[0][1]);
        return sum;
    };
    EXPECT_GT(amplitudes(coloured), 5 * amplitudes(plain));
    double of_stages[2] = {};
    for (const bool is_plain : {false, true})
        for (const FoldStage& stage : (is_plain ? plain : coloured).attribute<FoldStage>(stages_name))
            of_stages[is_plain] = std::max(of_stages[is_plain], static_cast<double>(stage.contrast[4][2][0]));
    EXPECT_GT(of_stages[0], 2 * of_stages[1]);
}

TEST(StandIns, HaveTheUsualContrast) {
    const TextureDetail noise = TextureDetail::stand_in(0.4f);
    const UvBox all = box({0, 0}, {1, 1}), small = box({0.3f, 0.3f}, {0.31f, 0.31f});
    for (std::size_t level = 0; level < noise.level_count(); ++level) {
        const float expected = level < measurement::stand_in_octaves ? measurement::usual_contrast : 0;
        EXPECT_NEAR(noise.contrast(level, all), expected, 0.01f) << level;
        EXPECT_NEAR(noise.contrast(level, small), expected, 0.01f) << level;
    }
    double sum = 0;
    constexpr int count = 200;
    for (int y = 0; y < count; ++y)
        for (int x = 0; x < count; ++x)
            sum += static_cast<double>(noise.at(0, (glm::vec2(x, y) + 0.5f) / static_cast<float>(count)));
    EXPECT_NEAR(sum / (count * count), 0.4, 0.02);
}

// Coordinates without an image place others, such as a normal map: what slides, counts.
TEST(StandIns, CountWhereNoImageIsDrawn) {
    Mesh even = textures::textured_grid(20, textures::checkerboard(1, 1, 1, 150, 150)), squeezed = even;
    for (glm::vec2& uv : squeezed.uvs) uv.x = uv.x * uv.x;
    for (const bool has_image : {true, false}) { // of one colour
        if (!has_image) even.texture = squeezed.texture = {};
        const auto contrast = [](const FoldTexture& t) { return *std::ranges::max_element(t.contrast); };
        EXPECT_LT(largest_inside(measured(even), contrast), 1e-3f) << has_image;
        EXPECT_GT(largest_inside(measured(squeezed), contrast), 0.02f) << has_image;
        EXPECT_GT(largest_contrast(measured(squeezed)), measurement::usual_contrast) << has_image;
    }
    // All at one place: no image shows anything.
    for (glm::vec2& uv : squeezed.uvs) uv = glm::vec2(0.5f);
    EXPECT_TRUE(measured(squeezed).attribute<FoldTexture>(texture_name).empty());
}

TEST(StandIns, AreKeptInFilesAndUnderLights) {
    Mesh mesh = textures::textured_sphere(2, {});
    const VertexTree tree = measured(mesh, false);
    const support::TempFolder folder;
    ASSERT_TRUE(write_tree(folder / "tree.vdt", tree));
    const auto read = require(read_tree(folder / "tree.vdt"));
    vdtree::View view;
    view.eye = {0, 0, 9};
    EXPECT_TRUE(require(error_distances(*read, view, {}))->is_monotone());
    const auto folds = require(LitFolds::measure(tree));
    const auto with = require(folds->with_attributes(tree));
    EXPECT_FALSE(with->attribute<FoldTexture>("lit_texture").empty());
    EXPECT_TRUE(require(LitFolds::of(*with))->under(tree, {.lights = {}, .ambient = 0.5}));
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
