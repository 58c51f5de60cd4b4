// Changes over time: elaTCSF against its published program, and the judge of changes against closed forms.
#include <unseen/perception/internal/change.h>

#include "testing.h"

#include "change/flicker.h"

namespace unseen::perception::change_test {

double decibels(double ratio) { return 20 * std::log10(ratio); }

struct Disc {
    double degrees, cdm2, radius_deg, hz, sensitivity;
};
// Numbers that the published program computed (gfxdisp/elaTCSF at 3d5b74f8, MIT licence), with 8 digits.
constexpr Disc published[] = {
    {0, 1, 0.5, 1, 46.291924},     {0, 1, 0.5, 4, 108.80362},    {0, 1, 0.5, 16, 24.491725},
    {0, 1, 0.5, 60, 0.0054632138}, {0, 1, 10, 2, 200.46342},     {0, 1, 10, 8, 297.71347},
    {0, 10, 2, 4, 286.20417},      {0, 10, 2, 30, 28.675018},    {0, 100, 0.5, 8, 181.42456},
    {0, 100, 2, 1, 106.32571},     {0, 100, 2, 8, 350.7484},     {0, 100, 10, 8, 573.4889},
    {0, 100, 10, 30, 145.46511},   {20, 1, 0.5, 1, 6.0119102},   {20, 1, 10, 8, 142.72139},
    {20, 10, 2, 16, 67.456456},    {20, 10, 10, 4, 130.67241},   {20, 100, 0.5, 2, 10.019133},
    {20, 100, 2, 8, 67.815},       {20, 100, 10, 16, 217.51108},
};
// Relative; the published program integrates in another way.
constexpr double published_tolerance = 2e-4;

// To a uniform disc about that eccentricity: in rings about the disc's centre, by the rule of midpoints; within 1e-4.
double disc_sensitivity(double hz, double degrees, double cdm2, double radius_deg) {
    constexpr int rings = 128, half_turns = 32;
    double sum = 0;
    for (int i = 0; i < rings; ++i) {
        const double ring = (i + 0.5) / rings * radius_deg;
        double mean = 0;
        for (int j = 0; j < half_turns; ++j) {
            const double turn = std::numbers::pi * (j + 0.5) / half_turns;
            const double here = std::hypot(degrees + ring * std::cos(turn), ring * std::sin(turn));
            mean += std::pow(flicker_sensitivity(hz, here, cdm2), flicker_pooling) / half_turns;
        }
        sum += mean * 2 * std::numbers::pi * ring * radius_deg / rings;
    }
    return std::pow(sum / flicker_pooling_deg2, 1 / flicker_pooling);
}

double share_of(double cpd) {
    double share = 0;
    for (const FlickerBlur& blur : flicker_blurs) share += blur.weight * std::exp(-cpd * cpd / (blur.cpd * blur.cpd));
    return share;
}

TEST(Flicker, IsThatOfThePublishedProgram) {
    for (const Disc& d : published)
        EXPECT_NEAR(disc_sensitivity(d.hz, d.degrees, d.cdm2, d.radius_deg) / d.sensitivity, 1, published_tolerance)
            << d.degrees << " deg, " << d.cdm2 << " cd/m2, radius " << d.radius_deg << ", " << d.hz << " Hz";
}

TEST(Flicker, OfCoarseThingsIsThatOfCastlesTransientChannel) {
    const auto transient = [](double cpd) {
        const double decades = std::log10(cpd / 0.000316696);
        return std::pow(10, -decades * decades / std::exp2(2.6761)) * cpd / std::hypot(1, cpd / 3.01389);
    };
    const double peak_cpd = 0.42966;
    for (double cpd = 1.0 / 16; cpd < 64; cpd *= 1.1)
        EXPECT_NEAR(share_of(cpd), cpd < peak_cpd ? 1 : transient(cpd) / transient(peak_cpd), 0.02) << cpd;
    EXPECT_NEAR(share_of(0), 1, 1e-9);
}

constexpr double grey_cdm2 = 50;

Display display_of(double ppd) {
    Display display;
    set_pixels_per_degree(display, PixelsPerDegree(ppd));
    return display;
}
template <class Light>
Image picture(int side, Light light) {
    Image image{side, side, 1, {}};
    for (int y = 0; y < side; ++y)
        for (int x = 0; x < side; ++x)
            image.values.push_back(static_cast<float>(light(x + 0.5 - side * 0.5, y + 0.5 - side * 0.5)));
    return image;
}
Image grey(int side) {
    return picture(side, [](double, double) { return grey_cdm2; });
}
// A Gabor patch; sizes in degrees.
Image gabor(int side, double ppd, double cpd, double sigma_deg, double contrast) {
    return picture(side, [=](double x, double y) {
        const double r = std::hypot(x, y) / ppd / sigma_deg;
        return grey_cdm2 * (1 + contrast * std::exp(-r * r / 2) * std::cos(2 * std::numbers::pi * cpd * x / ppd));
    });
}
// Smooth and wide: its flicker is seen, what lasts of it hardly.
Image blob(int side, double ppd, double sigma_deg, double contrast) {
    return picture(side, [=](double x, double y) {
        const double r = std::hypot(x, y) / ppd / sigma_deg;
        return grey_cdm2 * (1 + contrast * std::exp(-r * r / 2));
    });
}

Result<ChangeJudgement> judge_pop(const Image& before, const Image& after, const JudgeOptions& options) {
    return ChangeWatch(options).next(before, after, 0);
}
ChangeJudgement judged(const Image& before, const Image& after, double ppd) {
    const auto judgement = judge_pop(before, after, {.display = display_of(ppd), .gain = 1});
    EXPECT_TRUE(judgement) << judgement.error().message;
    return *judgement;
}

// A disc that pops is seen as well as one that flickers at its best frequency with 1 / 0.753 of the contrast.
TEST(ChangeJudge, ADiscThatPopsIsSeenByTheLawOfFlicker) {
    constexpr int side = 256;
    constexpr double ppd = 16, radius_deg = 2;
    double best = 0;
    for (double hz = 1; hz < 40; hz += 0.1) best = std::max(best, disc_sensitivity(hz, 0, grey_cdm2, radius_deg));
    constexpr double contrast = 0.01;
    const Image disc = picture(side, [](double x, double y) {
        return grey_cdm2 * (1 + (std::hypot(x, y) < radius_deg * ppd ? contrast : 0));
    });
    // In the middle of the window, without a gaze, everything is looked at: give one.
    JudgeOptions options{.display = display_of(ppd), .gaze_px = glm::dvec2(side * 0.5), .gain = 1};
    const auto popped = require(judge_pop(grey(side), disc, options));
    EXPECT_NEAR(decibels(popped->flicker / (contrast * 0.753 * best)), 0, 1);
    EXPECT_GT(popped->visibility, popped->flicker);
    EXPECT_GT(popped->visibility, popped->lasting);
    // Twice the contrast or twice the eye: twice the flicker.
    options.gain = 2;
    const auto sharper = judge_pop(grey(side), disc, options);
    EXPECT_NEAR(sharper->flicker / popped->flicker, 2, 1e-3);
}

// The finding that this is for: below 1 cpd people see what flickers at 4 to 10 Hz 8 to 10 dB better than what stands.
TEST(ChangeJudge, CoarseFlickerIsSeenBetterThanWhatStandsStill) {
    for (const double cpd : {0.3, 0.5, 0.7}) {
        const double still = sensitivity(
            CsfModel::castle,
            {.frequency = CyclesPerDegree(cpd), .luminance = Luminance(grey_cdm2), .area = SquareDegrees(20)});
        // Of a patch of 20 square degrees, a disc of which half the contrast's powers are left.
        double flicker = 0;
        for (const double hz : {4.0, 6.0, 8.0, 10.0})
            flicker = std::max(flicker, disc_sensitivity(hz, 0, grey_cdm2, std::sqrt(20 / std::numbers::pi)));
        EXPECT_GT(decibels(flicker * share_of(cpd) / still), 8) << cpd;
    }
}

TEST(ChangeJudge, AWidePopIsSeenAlthoughNothingLastsOfIt) {
    constexpr int side = 256;
    constexpr double ppd = 8; // 32 degrees
    const ChangeJudgement pop = judged(grey(side), blob(side, ppd, 4, 0.005), ppd);
    EXPECT_GT(pop.flicker, 1);
    EXPECT_LT(pop.lasting, 1);
    EXPECT_FALSE(pop.visibility < 1);
}

TEST(ChangeJudge, OfFineChangesOnlyTheLastingPartIsSeen) {
    constexpr int side = 128;
    constexpr double ppd = 32;
    const ChangeJudgement fine = judged(grey(side), gabor(side, ppd, 10, 0.15, 0.05), ppd);
    EXPECT_GT(fine.lasting, 0.5);
    EXPECT_LT(fine.flicker, 0.5 * fine.lasting);
    EXPECT_LT(fine.visibility, 1.05 * fine.lasting);
    const auto still = Judge::create(grey(side), {.display = display_of(ppd), .gain = 1});
    EXPECT_NEAR(fine.lasting, still->judge(gabor(side, ppd, 10, 0.15, 0.05))->max_ratio, 1e-4);
}

TEST(ChangeJudge, NothingIsSeenOfNoChange) {
    const ChangeJudgement none = judged(grey(64), grey(64), 30);
    EXPECT_EQ(none.visibility, 0);
}

TEST(ChangeJudge, AViewersTableCountsForFlickerToo) {
    constexpr double ppd = 8;
    JudgeOptions options{.display = display_of(ppd), .gain = 1};
    const Image before = grey(128), after = blob(128, ppd, 2, 0.01);
    const double plain = judge_pop(before, after, options)->flicker;
    options.csf_table = std::make_shared<const CsfTable>(*CsfTable::standard().scaled(3));
    EXPECT_NEAR(judge_pop(before, after, options)->flicker / plain, 3, 1e-4);
}

// What lasts of a glide is what lasts of a pop, and less of it flickers: half, in a quarter of a second.
TEST(ChangeWatch, FramesOfAGlideAddUp) {
    constexpr int side = 128, frames = 15;
    constexpr double ppd = 8, frame_s = 1.0 / 60;
    ChangeWatch watch({.display = display_of(ppd), .gain = 1});
    double flicker = 0, lasting = 0;
    for (int i = 1; i <= frames; ++i) {
        const auto step =
            watch.next(blob(side, ppd, 2, 0.02 * (i - 1) / frames), blob(side, ppd, 2, 0.02 * i / frames), frame_s);
        ASSERT_TRUE(step) << step.error().message;
        flicker = std::max(flicker, step->flicker);
        lasting = std::max(lasting, step->lasting);
    }
    const ChangeJudgement pop = judged(grey(side), blob(side, ppd, 2, 0.02), ppd);
    EXPECT_NEAR(flicker / pop.flicker, 0.46, 0.05);
    EXPECT_NEAR(lasting / pop.lasting, 1, 0.03);
    // What was long ago is forgotten.
    watch.pass(remembered_s);
    const auto later = require(watch.next(grey(side), blob(side, ppd, 2, 0.001), 0));
    EXPECT_NEAR(later->flicker / judged(grey(side), blob(side, ppd, 2, 0.001), ppd).flicker, 1, 1e-3);
    EXPECT_EQ(watch.next(grey(side), grey(side), frame_s)->visibility, 0);
}

TEST(ChangeWatch, AnotherWindowBeginsAnew) {
    ChangeWatch watch({.display = display_of(8), .gain = 1});
    ASSERT_TRUE(watch.next(grey(64), blob(64, 8, 1, 0.02), 0));
    const auto other = require(watch.next(grey(80), blob(80, 8, 1, 0.02), 0));
    EXPECT_NEAR(other->flicker, judged(grey(80), blob(80, 8, 1, 0.02), 8).flicker, 1e-4);
}

TEST(ChangeJudge, RefusesWhatIsNoChange) {
    const Image here = grey(16);
    const JudgeOptions options{.display = display_of(30)};
    Image dark = here;
    dark.values[3] = -1;
    EXPECT_THAT(judge_pop(here, dark, options).error().message, HasSubstr("pixel (3, 0)"));
    EXPECT_THAT(judge_pop(here, grey(17), options).error().message, HasSubstr("differ in size"));
    for (const double bad : {-1.0, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()})
        EXPECT_THAT(ChangeWatch(options).next(here, here, bad).error().message, HasSubstr("time"));
    EXPECT_THAT(judge_pop(here, dark, {.display = display_of(30), .beta = 0}).error().message, HasSubstr("beta"));
}

} // namespace unseen::perception::change_test
