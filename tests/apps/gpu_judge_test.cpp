// The judge on the GPU says what the one on the CPU says: of gratings, noise and rendered pictures, looked at and looked
// beside, of all shapes and luminances; and refuses what that one refuses.
#include <unseen/session_gpu/gpu_judge.h>

#include <unseen/perception/internal/judge_tables.h>
#include <unseen/render/internal/visibility_passes.h>
#include <unseen/render/renderer.h>

#include "built.h"
#include "gl_test.h"
#include "luminance_images.h"
#include "shapes.h"

namespace gpu_judge_test {

using namespace unseen;
using perception::Image;
using perception::Judge;
using perception::Judgement;
using perception::JudgeOptions;
using session::GpuJudge;
using support::flat;
using support::noise;
using GpuJudgeTest = render::testing::GlTest;

// Of all pixels but one in a thousand.
constexpr double full_tolerance = 1e-3; // relative
constexpr double full_floor = 1e-4;     // below, V is a rounding of float differences

// Cycles a pixel and contrast grow to the right and to the bottom.
Image gratings(int width, int height, double mean, double contrast) {
    Image image = flat(width, height, 0);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            const double across = (x + 0.5) / width, phase = std::numbers::pi * 0.5 * across * x;
            image.at(x, y) = static_cast<float>(mean * (1 + contrast * (y + 0.5) / height * std::cos(phase)));
        }
    return image;
}

struct Pair {
    std::string name;
    Image reference, test;
};

std::vector<Pair> pairs(int width, int height) {
    Image patched = noise(width, height, 20, 0.5, 1);
    for (int y = height / 3; y < height / 2; ++y)
        for (int x = width / 3; x < width / 2; ++x) patched.at(x, y) *= 1.1F;
    std::vector<Pair> all = {{"gratings", flat(width, height, 30), gratings(width, height, 30, 0.1)},
                             {"noise", noise(width, height, 20, 0.5, 1), patched},
                             {"noise on gratings", gratings(width, height, 50, 0.9), noise(width, height, 50, 0.9, 2)},
                             {"a step", flat(width, height, 20), flat(width, height, 21)}};
    return all;
}

JudgeOptions looking_aside(int width) { return {.gaze_px = glm::dvec2(width + 400, 30)}; }

// The relative error that one value in a thousand exceeds; values below `floor` count as `floor`.
double error_of(const std::vector<float>& is, const std::vector<float>& wanted, double floor) {
    EXPECT_EQ(is.size(), wanted.size());
    std::vector<double> errors;
    for (std::size_t i = 0; i < is.size(); ++i) {
        EXPECT_TRUE(std::isfinite(is[i])) << "pixel " << i;
        const auto w = static_cast<double>(wanted[i]);
        errors.push_back(std::abs(static_cast<double>(is[i]) - w) / std::max(w, floor));
    }
    if (errors.empty()) return 0;
    const auto nth = errors.begin() + static_cast<std::ptrdiff_t>(errors.size() - 1 - errors.size() / 1000);
    std::nth_element(errors.begin(), nth, errors.end());
    return *nth;
}

// Of the reference, as perception::threshold_map_modern().
std::vector<float> thresholds_of(GpuJudge& judge) {
    EXPECT_TRUE(judge.passes().map_thresholds());
    return *require(judge.passes().read_thresholds());
}

void expect_alike(const render::Context& context, const Pair& pair, const JudgeOptions& options) {
    const auto cpu = perception::judge_modern(pair.reference, pair.test, options);
    const auto cpu_map = perception::threshold_map_modern(pair.reference, options);
    ASSERT_TRUE(cpu && cpu_map) << pair.name;
    const std::string what = pair.name + " of " + std::to_string(pair.reference.width) + "x" +
                             std::to_string(pair.reference.height) + (options.gaze_px ? " aside" : "");
    auto gpu = require(GpuJudge::create(context, pair.reference, options));
    const auto judged = require(gpu->judge(pair.test));
    const auto& v = judged->visibility.values;
    EXPECT_LE(error_of(v, cpu->visibility.values, full_floor), full_tolerance) << what;
    // Summed up as they are in the map.
    EXPECT_EQ(judged->pixels, cpu->pixels) << what;
    EXPECT_EQ(judged->max_ratio, static_cast<double>(*std::max_element(v.begin(), v.end()))) << what;
    EXPECT_EQ(judged->visible_pixels,
              static_cast<std::uint64_t>(std::count_if(v.begin(), v.end(), [](float x) { return !(x < 1); })))
        << what;
    EXPECT_LE(error_of(thresholds_of(*gpu), cpu_map->values, 0), full_tolerance) << what;
    EXPECT_EQ(context.take_errors(), "") << what;
}

TEST_F(GpuJudgeTest, JudgesAsTheCpuDoes) {
    for (const Pair& pair : pairs(256, 256)) {
        expect_alike(context(), pair, {});
        expect_alike(context(), pair, looking_aside(256));
    }
}

TEST_F(GpuJudgeTest, JudgesPicturesOfAnyShape) {
    for (const auto& [width, height] : {std::pair{1, 1},
                                        {2, 1},
                                        {1, 2},
                                        {3, 3},
                                        {4, 4},
                                        {1, 301},
                                        {301, 1},
                                        {5, 64},
                                        {7, 7},
                                        {8, 9},
                                        {17, 33},
                                        {203, 101},
                                        {513, 66}}) {
        const Pair pair = pairs(width, height)[2]; // all of them: JudgesAsTheCpuDoes
        expect_alike(context(), pair, {});
        expect_alike(context(), pair, looking_aside(width));
    }
}

TEST_F(GpuJudgeTest, JudgesForOtherObserversAndDisplays) {
    const Pair pair = pairs(130, 90)[1];
    expect_alike(context(), pair,
                 perception::second_judge_options(perception::strict_person)); // squares over the bands
    JudgeOptions options{.beta = 5};                                           // any exponent
    expect_alike(context(), pair, options);
    options = looking_aside(130);
    options.csf = perception::CsfModel::daly; // whose loss aside depends on luminance
    expect_alike(context(), pair, options);
    options.csf_table = std::make_shared<const perception::CsfTable>(perception::CsfTable::standard());
    options.gaze_px = glm::dvec2(65, 45); // in the picture
    expect_alike(context(), pair, options);
    // So fine that there are more than 8 bands.
    options = {};
    perception::set_pixels_per_degree(options.display, perception::PixelsPerDegree(300));
    ASSERT_GT(perception::judge_tables(2100, 2048, 1, 2, options)->bands.size(), 8U);
    const Pair fine = pairs(2100, 2048)[1];
    expect_alike(context(), fine, options);
}

TEST_F(GpuJudgeTest, JudgesRenderedPictures) {
    const auto tree = support::built(shapes::bumpy_sphere(4));
    auto renderer = require(render::Renderer::create(context(), tree));
    vdtree::View view;
    view.width = view.height = 300;
    view = vdtree::frame_sphere(tree.origin(), 1.1, {0.3, 0.2, 1}, 0.8, view);
    const perception::Display display;
    const auto drawn = [&](const vdtree::Cut& cut) {
        const auto frame = renderer->draw(cut, view);
        EXPECT_TRUE(frame);
        Image image{300, 300, 1, frame->luminance};
        for (float& v : image.values)
            v = static_cast<float>(perception::to_luminance(display, static_cast<double>(v)).value());
        return image;
    };
    vdtree::Cut cut(tree);
    cut.unfold_all();
    const Image full = drawn(cut);
    const auto coarse = [](const vdtree::VertexTree& t, std::span<const vdtree::NodeId> nodes, std::span<float> costs) {
        for (std::size_t i = 0; i < nodes.size(); ++i) costs[i] = t.support_spheres()[nodes[i]].radius / 0.15F;
    };
    cut.adjust(coarse);
    const Pair pair{"a sphere", full, drawn(cut)};
    ASSERT_NE(pair.reference.values, pair.test.values);
    expect_alike(context(), pair, {});
    expect_alike(context(), pair, looking_aside(300));
}

// Nobody multiplies what is on the GPU by hand: relative luminance of a target becomes cd/m2 on the way.
TEST_F(GpuJudgeTest, JudgesTexturesAsTheyLie) {
    const perception::Display display;
    const auto scale = static_cast<float>((display.peak - display.black).value()),
               black = static_cast<float>(display.black.value());
    const auto relative = [&](unsigned seed) { return noise(61, 40, 0.4, 0.5, seed); };
    const Image a = relative(1), b = relative(2);
    const auto up_a = require(render::LuminanceImage::create(context(), 61, 40, a.values)),
               up_b = require(render::LuminanceImage::create(context(), 61, 40, b.values));
    auto texture_a = up_a->texture(), texture_b = up_b->texture();
    texture_a.scale = texture_b.scale = scale;
    texture_a.offset = texture_b.offset = black;
    auto judge = require(GpuJudge::create(context(), texture_a, {}));
    const auto summary = require(judge->judge(texture_b));
    const auto in_cdm2 = [&](Image image) {
        for (float& v : image.values) v = v * scale + black;
        return image;
    };
    const auto cpu = require(perception::judge_modern(in_cdm2(a), in_cdm2(b), {}));
    EXPECT_NEAR(summary->largest / cpu->max_ratio, 1, full_tolerance);
    EXPECT_EQ(judge->judge(texture_a)->largest, 0);
}

TEST_F(GpuJudgeTest, SeesNothingInEqualPicturesAndTheSameInTheSame) {
    const Image a = noise(203, 150, 20, 0.9, 1), b = noise(203, 150, 20, 0.9, 2);
    for (const JudgeOptions& options : {JudgeOptions{}, looking_aside(203)}) {
        auto judge = require(GpuJudge::create(context(), a, options));
        const auto first = require(judge->judge(b));
        EXPECT_GT(first->visible_pixels, 0U);
        const auto nothing = require(judge->judge(a));
        EXPECT_EQ(nothing->max_ratio, 0);
        EXPECT_EQ(nothing->visible_pixels, 0U);
        EXPECT_THAT(nothing->visibility.values, ::testing::Each(0.F));
        auto other = require(GpuJudge::create(context(), a, options));
        EXPECT_EQ(judge->judge(b)->visibility.values, first->visibility.values);
        EXPECT_EQ(other->judge(b)->visibility.values, first->visibility.values);
    }
}

TEST_F(GpuJudgeTest, StaysFiniteInTheDarkAndInTheSun) {
    constexpr float denormal = 1e-41F;
    JudgeOptions steep, behind = looking_aside(66);
    steep.beta = 8, steep.gain = 1000;
    behind.gaze_px = glm::dvec2(-1e300, 1e300);
    for (const float dots : {denormal, 0.5F, 1e5F, 1e30F})
        for (const float ground : {0.F, denormal, 100.F, 1e5F}) {
            Image a = flat(66, 50, ground), b = a;
            for (int y = 0; y < 50; y += 2)
                for (int x = 0; x < 66; x += 2) b.at(x, y) = dots;
            for (const JudgeOptions& options : {JudgeOptions{}, looking_aside(66), steep, behind})
                for (const auto& [reference, test] : {std::pair(a, b), std::pair(b, a)}) {
                    auto judge = require(GpuJudge::create(context(), reference, options));
                    const auto judged = require(judge->judge(test));
                    const std::vector<float> map = thresholds_of(*judge);
                    const auto is_sound = [](float v) { return v >= 0 && std::isfinite(v); };
                    EXPECT_TRUE(std::isfinite(judged->max_ratio));
                    EXPECT_TRUE(
                        std::all_of(judged->visibility.values.begin(), judged->visibility.values.end(), is_sound))
                        << dots << " on " << ground;
                    EXPECT_TRUE(std::all_of(map.begin(), map.end(), is_sound)) << dots << " on " << ground;
                    const auto cpu = perception::judge_modern(reference, test, options);
                    if (dots <= 1e5F)
                        EXPECT_NEAR(judged->max_ratio, cpu->max_ratio,
                                    full_tolerance * std::max(cpu->max_ratio, full_floor))
                            << dots << " on " << ground;
                }
        }
}

// On a flat field the threshold is the luminance over the best sensitivity of a band, by the closed form.
TEST_F(GpuJudgeTest, ThresholdsOfFlatFieldsAreTheClosedForm) {
    constexpr double tolerance = 2e-3; // 1e-3 of the judge's tables, and as much of the GPU
    constexpr double base_band = 0.02; // which may know a better frequency
    const double ppd = perception::pixels_per_degree(perception::Display{}).value();
    for (const double luminance : {0.7, 21.0, 95.0}) {
        auto judge = require(GpuJudge::create(context(), flat(1024, 1024, static_cast<float>(luminance)),
                                              {.gain = perception::median_person.gain}));
        const std::vector<float> map = thresholds_of(*judge);
        double best = 0;
        for (int k = 0; k < 8; ++k) {
            perception::Stimulus s;
            s.frequency = perception::CyclesPerDegree((k == 0 ? 1 : 0.3228 * std::exp2(1 - k)) * ppd / 2);
            s.luminance = perception::Luminance(luminance);
            s.area = perception::patch_area(s.frequency);
            best = std::max(best, perception::sensitivity(perception::CsfModel::castle, s));
        }
        const double at_corner = map[0] * best / luminance, in_the_middle = map[613 * 1024 + 511] * best / luminance;
        EXPECT_NEAR(at_corner, 1, tolerance + base_band) << luminance;
        EXPECT_NEAR(at_corner, in_the_middle, tolerance) << luminance;
    }
}

TEST_F(GpuJudgeTest, RefusesWhatTheCpuRefuses) {
    const Image good = flat(8, 9, 1);
    auto judge = require(GpuJudge::create(context(), good, {}));
    for (const float value : {-1.0F, -std::numeric_limits<float>::denorm_min(), std::numeric_limits<float>::quiet_NaN(),
                              std::numeric_limits<float>::infinity()}) {
        Image bad = good;
        bad.values[11] = bad.values[40] = value;
        const auto as_cpu = perception::judge_modern(good, bad, {});
        ASSERT_FALSE(as_cpu);
        const auto judged = judge->judge(bad);
        ASSERT_FALSE(judged) << value;
        EXPECT_EQ(judged.error().message, as_cpu.error().message);
        const auto made = GpuJudge::create(context(), bad, {});
        ASSERT_FALSE(made) << value;
        EXPECT_EQ(made.error().message, Judge::create(bad, {}).error().message);
    }
    const auto other = judge->judge(flat(9, 8, 1));
    ASSERT_FALSE(other);
    EXPECT_EQ(other.error().message, perception::judge_modern(good, flat(9, 8, 1), {}).error().message);
    EXPECT_FALSE(judge->judge(flat(0, 0, 1)));
    Image colour = flat(8, 9, 1);
    colour.channels = 3;
    EXPECT_FALSE(judge->judge(colour));
    EXPECT_FALSE(GpuJudge::create(context(), colour, {}));
    Image short_one = good;
    short_one.values.pop_back();
    EXPECT_FALSE(judge->judge(short_one));
    const int too_many = render::largest_target_side() + 1;
    EXPECT_THAT(error_in(GpuJudge::create(context(), flat(too_many, 1, 1), {})), HasSubstr("textures"));
    EXPECT_FALSE(GpuJudge::create(context(), good, {.beta = std::nan("")}));
    EXPECT_FALSE(GpuJudge::create(context(), good, {.gain = 0}));
    EXPECT_FALSE(GpuJudge::create(context(), good, {.gaze_px = glm::dvec2(std::nan(""), 0)}));
    // It judges on after all that.
    Image brighter = good;
    brighter.values[11] = 2;
    EXPECT_GT(judge->judge(brighter)->max_ratio, 0);
    EXPECT_EQ(judge->judge(good)->max_ratio, 0);
}

TEST_F(GpuJudgeTest, KnowsNoEccentricityWithoutAGaze) {
    const auto none = require(perception::judge_tables(640, 480, 1, 100, {}));
    EXPECT_FALSE(none->gaze);
    EXPECT_EQ(none->eccentricities, 1);
    for (const auto& band : none->bands) EXPECT_EQ(band.nodes.size(), static_cast<std::size_t>(none->luminances));
    const auto aside = require(perception::judge_tables(640, 480, 1, 100, looking_aside(640)));
    EXPECT_TRUE(aside->gaze);
    EXPECT_GT(aside->eccentricities, 5);
    for (const auto& [low, high] :
         {std::pair(2.F, 1.F), {-1.F, 1.F}, {0.F, std::numeric_limits<float>::infinity()}, {std::nanf(""), 1.F}})
        EXPECT_FALSE(perception::judge_tables(4, 4, low, high, {}));
    EXPECT_FALSE(perception::judge_tables(0, 4, 1, 2, {}));
}

} // namespace gpu_judge_test
