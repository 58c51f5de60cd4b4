// Maps of thresholds on the GPU say what those on the CPU say, of one reference after another.

#define GL_GLEXT_PROTOTYPES 1
#include <GL/glcorearb.h>

#include <unseen/perception/internal/judge_tables.h>
#include <unseen/render/internal/elevation.h>
#include <unseen/render/target.h>
#include <unseen/session_gpu/gpu_judge.h>

#include "gl_test.h"
#include "luminance_images.h"
#include "shapes.h"

namespace threshold_maps_test {

using namespace unseen;
using perception::Image;
using render::LuminanceImage;
using support::flat;
using support::noise;
using ThresholdMapsTest = render::testing::GlTest;

// Relative, of all pixels but one in a thousand; pictures in half floats have 11 bits.
constexpr double full_tolerance = 1e-3, half_tolerance = 0.01;

// A table is linear where the formula of TVI has steps, at 0.036 and 79.4 cd/m2; few pixels have just that luminance, but
// one of few may.
constexpr double step_of_tvi = 0.03;

// Slow on the left, fast on the right, and half of it dark.
Image waves(int width, int height, double mean, double contrast) {
    Image image = flat(width, height, 0);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            const double across = (x + 0.5) / width, level = y < height / 2 ? mean : mean / 30;
            image.at(x, y) = static_cast<float>(level * (1 + contrast * std::cos(1.5 * across * x)));
        }
    return image;
}

// Nearly nothing to see, but that counts: contrasts of 1e-6 and less.
Image slope(int width, int height) {
    Image image = flat(width, height, 0);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
            image.at(x, y) = 20.F + 0.01F * static_cast<float>(x) + 0.003F * static_cast<float>(y);
    return image;
}

double error_of(const std::vector<float>& is, const std::vector<float>& wanted) {
    EXPECT_EQ(is.size(), wanted.size());
    std::vector<double> errors;
    for (std::size_t i = 0; i < is.size(); ++i) {
        EXPECT_TRUE(std::isfinite(is[i]) && is[i] > 0) << "pixel " << i << ": " << is[i];
        const auto w = static_cast<double>(wanted[i]);
        errors.push_back(std::abs(static_cast<double>(is[i]) - w) / w);
    }
    const auto nth = errors.begin() + static_cast<std::ptrdiff_t>(errors.size() - 1 - errors.size() / 1000);
    std::nth_element(errors.begin(), nth, errors.end());
    return *nth;
}

// The picture as a texture, in half floats or whole ones.
class Texture {
public:
    Texture(const Image& image, bool is_half) : width_(image.width), height_(image.height) {
        glCreateTextures(GL_TEXTURE_2D, 1, &id_);
        glTextureStorage2D(id_, 1, is_half ? GL_R16F : GL_R32F, width_, height_);
        glTextureSubImage2D(id_, 0, 0, 0, width_, height_, GL_RED, GL_FLOAT, image.values.data());
    }
    Texture(const Texture&) = delete;
    ~Texture() { glDeleteTextures(1, &id_); }
    Image read() const {
        Image image = flat(width_, height_, 0);
        const auto bytes = static_cast<GLsizei>(image.values.size() * sizeof(float));
        glGetTextureImage(id_, 0, GL_RED, GL_FLOAT, bytes, image.values.data());
        return image;
    }
    render::LuminanceTexture texture() const { return {.id = id_, .width = width_, .height = height_}; }

private:
    int width_, height_;
    GLuint id_ = 0;
};

struct Shape {
    int width, height;
};
const Shape shapes_of_all_kinds[] = {{256, 256}, {1, 1}, {2, 1}, {3, 3}, {1, 37}, {37, 1}, {5, 4}, {203, 101}};

std::vector<std::pair<std::string, Image>> pictures(int width, int height) {
    return {{"noise", noise(width, height, 20, 0.9, 1)},
            {"faint noise", noise(width, height, 60, 1e-4, 2)},
            {"waves", waves(width, height, 50, 0.8)},
            {"a slope", slope(width, height)},
            {"flat", flat(width, height, 30)}};
}

TEST_F(ThresholdMapsTest, OneReferenceAfterAnotherAsTheCpu) {
    for (const auto& [width, height] : shapes_of_all_kinds) {
        // One set of tables, of all that a display shows.
        const auto tables = require(perception::judge_tables(width, height, 0, 100, {}));
        const auto first = LuminanceImage::create(context(), width, height, flat(width, height, 1).values);
        auto passes = require(render::VisibilityPasses::create(context(), *tables, first->texture()));
        const auto all = pictures(width, height);
        for (const bool is_half : {false, true}) {
            for (std::size_t i = 0; i < all.size(); ++i) {
                const Texture texture(all[i].second, is_half);
                ASSERT_TRUE(passes->set_reference(texture.texture()));
                ASSERT_TRUE(passes->map_thresholds(static_cast<int>(i)));
            }
            for (std::size_t i = 0; i < all.size(); ++i) {
                const auto wanted = perception::threshold_map_modern(all[i].second, {});
                const auto map = passes->read_thresholds(static_cast<int>(i));
                ASSERT_TRUE(wanted && map);
                EXPECT_LE(error_of(*map, wanted->values), is_half ? half_tolerance : full_tolerance)
                    << all[i].first << " of " << width << "x" << height << (is_half ? " in half floats" : "");
            }
        }
    }
}

TEST_F(ThresholdMapsTest, AnotherReferenceIsJudgedByAsIfItWereTheFirst) {
    const Image a = noise(90, 61, 20, 0.5, 1), b = noise(90, 61, 40, 0.3, 2), test = noise(90, 61, 30, 0.4, 3);
    const auto up_a = LuminanceImage::create(context(), 90, 61, a.values),
               up_b = LuminanceImage::create(context(), 90, 61, b.values),
               up_test = LuminanceImage::create(context(), 90, 61, test.values);
    const auto tables = *perception::judge_tables(90, 61, 0, 100, {});
    auto fresh = render::VisibilityPasses::create(context(), tables, up_b->texture());
    auto used = render::VisibilityPasses::create(context(), tables, up_a->texture());
    ASSERT_TRUE(fresh && used);
    ASSERT_TRUE(used->judge(up_test->texture()));
    ASSERT_TRUE(used->map_thresholds());
    ASSERT_TRUE(used->set_reference(up_b->texture()));
    EXPECT_FALSE(used->summary()) << "of the reference before";
    ASSERT_TRUE(used->map_thresholds(1));
    ASSERT_TRUE(used->judge(up_test->texture()));
    ASSERT_TRUE(fresh->judge(up_test->texture()));
    ASSERT_TRUE(fresh->map_thresholds());
    EXPECT_EQ(*used->read_visibility(), *fresh->read_visibility());
    EXPECT_EQ(*used->read_thresholds(1), *fresh->read_thresholds());
    EXPECT_NE(*used->read_thresholds(0), *used->read_thresholds(1));
    EXPECT_EQ(used->thresholds_texture(2), 0u);
    EXPECT_FALSE(used->read_thresholds(2));
    EXPECT_THAT(used->map_thresholds(16).error().message, HasSubstr("0 to 15, not 16"));
    const auto other = LuminanceImage::create(context(), 61, 90, a.values);
    EXPECT_THAT(used->set_reference(other->texture()).error().message, HasSubstr("90x61, not 61x90"));
    EXPECT_TRUE(used->read_visibility()) << "what is refused changes nothing";
}

// Frame after frame the same textures.
TEST_F(ThresholdMapsTest, KeepsWhatTheNextReferenceNeeds) {
    const auto image = LuminanceImage::create(context(), 64, 64, noise(64, 64, 20, 0.5, 1).values);
    const auto tables = *perception::judge_tables(64, 64, 0, 100, {});
    auto passes = render::VisibilityPasses::create(context(), tables, image->texture());
    EXPECT_EQ(passes->texture_bytes(), 64u * 64 * 4) << "the reference alone: its weights are made for judging";
    ASSERT_TRUE(passes->map_thresholds());
    EXPECT_EQ(passes->texture_bytes(), 64u * 64 * 8);
    ASSERT_TRUE(passes->set_reference(image->texture()));
    ASSERT_TRUE(passes->map_thresholds());
    const auto bytes = passes->texture_bytes();
    const int before = passes->full_screen_passes();
    for (int i = 0; i < 3; ++i) {
        ASSERT_TRUE(passes->set_reference(image->texture()));
        ASSERT_TRUE(passes->map_thresholds());
    }
    EXPECT_EQ(passes->texture_bytes(), bytes);
    // A copy; a step for each band, 3 passes to split each but the base, and 1 of that; 2 to pool them.
    EXPECT_EQ(passes->full_screen_passes() - before, 3 * static_cast<int>(1 + 4 * tables.bands.size() - 2 + 2));
    ASSERT_TRUE(passes->map_thresholds()) << "nothing is new";
    EXPECT_EQ(passes->full_screen_passes() - before, 3 * static_cast<int>(1 + 4 * tables.bands.size() - 2 + 2));
}

TEST_F(ThresholdMapsTest, Rpg99IsTheCpus) {
    for (const double field : {14.9, 45.0})
        for (const auto& [width, height] : shapes_of_all_kinds) {
            const auto tables = require(perception::rpg99_tables(width, field));
            auto passes = require(render::ElevationPasses::create(context(), width, height, *tables));
            const auto all = pictures(width, height);
            for (const bool is_half : {false, true})
                for (std::size_t i = 0; i < all.size(); ++i) {
                    const Texture texture(all[i].second, is_half);
                    ASSERT_TRUE(passes->map_thresholds(texture.texture(), static_cast<int>(i)));
                    const auto wanted = perception::rpg99_map(all[i].second, all[i].second, field);
                    const auto map = passes->read_thresholds(static_cast<int>(i));
                    ASSERT_TRUE(wanted && map);
                    const std::string what = all[i].first + " of " + std::to_string(width) + "x" +
                                             std::to_string(height) + (is_half ? " in half floats" : "");
                    const Image as_it_lies = texture.read();
                    const auto of_that = perception::rpg99_map(as_it_lies, as_it_lies, field);
                    EXPECT_LE(error_of(*map, of_that->threshold.values), full_tolerance) << what;
                    // The bands' shares of the contrast are what elevates, however little of it there is. So what half
                    // floats round counts in smooth pictures, by 5 to 8% here.
                    const bool is_smooth = all[i].first != "noise" && all[i].first != "flat";
                    if (is_half && is_smooth) continue;
                    EXPECT_LE(error_of(*map, wanted->threshold.values), is_half ? half_tolerance : full_tolerance)
                        << what;
                }
        }
}

TEST_F(ThresholdMapsTest, StayFiniteInTheDarkAndInTheSun) {
    constexpr float denormal = 1e-41F;
    for (const auto& [width, height] : {std::pair{66, 50}, {1, 1}, {5, 3}}) {
        constexpr double field = 20;
        auto elevation =
            render::ElevationPasses::create(context(), width, height, *perception::rpg99_tables(width, field));
        const auto first = LuminanceImage::create(context(), width, height, flat(width, height, 1).values);
        auto modern = render::VisibilityPasses::create(context(), *perception::judge_tables(width, height, 0, 1e5F, {}),
                                                       first->texture());
        ASSERT_TRUE(elevation && modern);
        for (const float dots : {0.F, denormal, 0.5F, 1e5F})
            for (const float ground : {0.F, denormal, 100.F, 1e5F}) {
                Image image = flat(width, height, ground);
                for (std::size_t i = 0; i < image.values.size(); i += 3) image.values[i] = dots;
                const auto up = LuminanceImage::create(context(), width, height, image.values);
                ASSERT_TRUE(elevation->map_thresholds(up->texture()));
                const auto map = elevation->read_thresholds();
                const auto wanted = perception::rpg99_map(image, image, field);
                ASSERT_TRUE(map && wanted);
                EXPECT_LE(error_of(*map, wanted->threshold.values), step_of_tvi) << dots << " on " << ground;
                ASSERT_TRUE(modern->set_reference(up->texture()));
                ASSERT_TRUE(modern->map_thresholds());
                const auto by_bands = require(perception::threshold_map_modern(image, {}));
                EXPECT_LE(error_of(*modern->read_thresholds(), by_bands->values), full_tolerance)
                    << dots << " on " << ground;
            }
    }
}

TEST_F(ThresholdMapsTest, RefuseWhatIsNone) {
    const auto good = *perception::rpg99_tables(8, 20);
    EXPECT_FALSE(perception::rpg99_tables(0, 20));
    EXPECT_FALSE(perception::rpg99_tables(8, 180));
    EXPECT_FALSE(perception::rpg99_tables(8, std::nan("")));
    EXPECT_FALSE(render::ElevationPasses::create(context(), 0, 8, good));
    EXPECT_THAT(render::ElevationPasses::create(context(), render::largest_target_side() + 1, 8, good).error().message,
                HasSubstr("textures"));
    auto passes = require(render::ElevationPasses::create(context(), 8, 8, good));
    EXPECT_FALSE(passes->read_thresholds());
    const auto other = LuminanceImage::create(context(), 9, 8, flat(9, 8, 1).values);
    EXPECT_THAT(passes->map_thresholds(other->texture()).error().message, HasSubstr("8x8, not 9x8"));
    EXPECT_FALSE(passes->map_thresholds(other->texture(), -1));
}

} // namespace threshold_maps_test
