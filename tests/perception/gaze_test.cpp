// Gazes: traces and their errors, the statistics of simulated ones, and what a tracker makes of them.
#include <unseen/perception/gaze.h>

#include "testing.h"

namespace unseen::perception::gaze_test {

GazeTrace trace_of(std::vector<GazeTrace::Sample> samples) {
    auto trace = GazeTrace::create(std::move(samples));
    EXPECT_TRUE(trace) << trace.error().message;
    return *std::move(trace);
}

TEST(GazeTest, InterpolatesBetweenSamples) {
    const GazeTrace trace = trace_of({{0, {100, 200}}, {0.5, {200, 100}}, {1.25, {200, -50.5}}});
    EXPECT_EQ(trace.at(0.25), glm::dvec2(150, 150));
    EXPECT_EQ(trace.at(-1), glm::dvec2(100, 200));
    EXPECT_EQ(trace.at(9), glm::dvec2(200, -50.5));
    EXPECT_EQ(trace.at(0.5), glm::dvec2(200, 100));
}

TEST(GazeTest, BadTracesNameTheSample) {
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    const std::pair<std::vector<GazeTrace::Sample>, const char*> cases[] = {
        {{}, "at least one sample"},
        {{{nan, {1, 2}}}, "sample 0 has a time_s that is not finite"},
        {{{0, {1, 2}}, {0.1, {1, nan}}}, "sample 1 has an y_px that is not finite"},
        {{{0, {-1e300, 2}}}, "sample 0 has an x_px of -1e+300"},
        {{{0.2, {1, 2}}, {0.1, {1, 2}}}, "sample 1 is out of order: time_s 0.1 s comes after 0.2 s"},
        {{{0, {1, 2}}, {0, {1, 2}}}, "sample 1 is out of order"},
        {{{0, {1, 2}}, {1.5, {1, 2}}}, "sample 1 follows a gap of 1.5 s"},
    };
    for (const auto& [samples, expected] : cases)
        EXPECT_THAT(error_in(GazeTrace::create(samples)), HasSubstr(expected)) << expected;
}

TEST(GazeTest, SimulatedGazesRepeatWithTheirSeed) {
    const auto a = simulate_gaze({.seed = 5}, Display()), b = simulate_gaze({.seed = 5}, Display()),
               c = simulate_gaze({.seed = 6}, Display());
    ASSERT_TRUE(a && b && c);
    EXPECT_EQ(a->samples(), b->samples());
    EXPECT_NE(a->samples(), c->samples());
}

// The statistics that the header claims, found again in the samples.
TEST(GazeTest, SimulatedGazesHaveThePublishedStatistics) {
    SimulatedGaze options;
    options.duration_s = 600;
    options.samples_per_s = 1000;
    options.width_px = 3000; // 75 degrees, so that the window's edges hardly matter
    options.height_px = 3000;
    const Display display;
    const auto trace = require(simulate_gaze(options, display));
    const auto& s = trace->samples();
    const auto degrees = [&](glm::dvec2 px) {
        const glm::dvec2 t = (px - glm::dvec2(1500)) * (0.000254 / 0.5);
        return glm::dvec2(std::atan(t.x), std::atan(t.y)) * (180 / std::numbers::pi);
    };
    std::vector<double> fixations, amplitudes, durations, peaks;
    for (std::size_t i = 1; i < s.size();) {
        std::size_t end = i;
        while (end < s.size() && s[end].px == s[end - 1].px) ++end;
        if (end == s.size()) break;
        if (!amplitudes.empty()) fixations.push_back(s[end - 1].time_s - s[i - 1].time_s);
        std::size_t landed = end;
        double peak = 0;
        while (landed < s.size() && s[landed].px != s[landed - 1].px) {
            const glm::dvec2 step = degrees(s[landed].px) - degrees(s[landed - 1].px);
            peak = std::max(peak, std::hypot(step.x, step.y) * options.samples_per_s);
            ++landed;
        }
        if (landed == s.size()) break;
        const glm::dvec2 moved = degrees(s[landed - 1].px) - degrees(s[end - 1].px);
        amplitudes.push_back(std::hypot(moved.x, moved.y));
        durations.push_back(s[landed - 1].time_s - s[end - 1].time_s);
        peaks.push_back(peak);
        i = landed;
    }
    ASSERT_GT(amplitudes.size(), 1500u);
    std::nth_element(fixations.begin(), fixations.begin() + static_cast<std::ptrdiff_t>(fixations.size() / 2),
                     fixations.end());
    EXPECT_NEAR(fixations[fixations.size() / 2], 0.25, 0.015);
    double mean = 0;
    for (const double a : amplitudes) mean += a / static_cast<double>(amplitudes.size());
    EXPECT_GT(mean, 4);
    EXPECT_LT(mean, 7);
    EXPECT_LT(std::count_if(amplitudes.begin(), amplitudes.end(), [](double a) { return a > 15; }),
              static_cast<std::ptrdiff_t>(amplitudes.size() / 20));
    for (std::size_t i = 0; i < amplitudes.size(); ++i) {
        constexpr double two_samples = 0.002;
        EXPECT_NEAR(durations[i], 0.0022 * amplitudes[i] + 0.021, two_samples) << i;
        if (amplitudes[i] < 2) continue;
        const double main_sequence = 600 * (1 - std::exp(-amplitudes[i] / 6));
        EXPECT_GT(peaks[i], 0.6 * main_sequence) << amplitudes[i];
        EXPECT_LT(peaks[i], 1.4 * main_sequence) << amplitudes[i];
    }
}

TEST(GazeTest, SimulatedGazesStayInTheWindow) {
    for (const int side : {1, 40, 1024}) {
        const auto trace = require(simulate_gaze({.duration_s = 20, .width_px = side, .height_px = side}, Display()));
        for (const GazeTrace::Sample& s : trace->samples()) {
            EXPECT_GE(std::min(s.px.x, s.px.y), -1e-9);
            EXPECT_LE(std::max(s.px.x, s.px.y), side + 1e-9);
        }
    }
    EXPECT_FALSE(simulate_gaze({.duration_s = std::nan("")}, Display()));
    EXPECT_FALSE(simulate_gaze({.duration_s = 1e9}, Display()));
    EXPECT_FALSE(simulate_gaze({.width_px = 0}, Display()));
    EXPECT_FALSE(simulate_gaze({.samples_per_s = 0.1}, Display()));
}

// A fixation, a saccade of 10 degrees in 50 ms, another fixation.
GazeTrace one_saccade() {
    const double px = std::tan(10 * std::numbers::pi / 180) * 0.5 / 0.000254;
    return trace_of({{0, {800, 600}}, {0.5, {800, 600}}, {0.55, {800 + px, 600}}, {1, {800 + px, 600}}});
}

TEST(GazeTest, ErrorAndLatencyWidenTheFovea) {
    GazeTracker::Options options;
    options.error_deg = 0.5;
    options.latency_s = 0.06;
    const GazeTracker tracker(one_saccade(), options, Display(), 1600, 1200);
    EXPECT_EQ(tracker.at(0.4).margin_deg, 0.5);
    EXPECT_EQ(tracker.at(0.52).px, glm::dvec2(800, 600)) << "what the eye did 60 ms ago";
    const GazeTracker::Gaze amid = tracker.at(0.585);
    EXPECT_NEAR(amid.speed_deg_s, 200, 1e-6);
    EXPECT_NEAR(amid.margin_deg, 0.5 + 200 * 0.06, 1e-6);
    EXPECT_EQ(tracker.at(0.9).margin_deg, 0.5);
    EXPECT_GT(tracker.at(0.9).px.x, 1100);
}

TEST(GazeTest, SuppressionHoldsTheGazeDuringSaccades) {
    GazeTracker::Options options;
    options.latency_s = 0.02;
    options.suppression = true;
    options.suppressed_s = 0.1;
    const GazeTracker tracker(one_saccade(), options, Display(), 1600, 1200);
    for (const double t : {0.53, 0.56, 0.6, 0.61}) {
        EXPECT_NEAR(tracker.at(t).px.x, 800, 1e-6) << t;
        EXPECT_EQ(tracker.at(t).margin_deg, 0) << t;
    }
    EXPECT_GT(tracker.at(0.63).px.x, 1100);
}

TEST(GazeTest, TrackersThatAreNoneAreRefused) {
    const double nan = std::nan("");
    EXPECT_FALSE(validate(GazeTracker::Options{.error_deg = -1}));
    EXPECT_FALSE(validate(GazeTracker::Options{.error_deg = nan}));
    EXPECT_FALSE(validate(GazeTracker::Options{.latency_s = nan}));
    EXPECT_FALSE(validate(GazeTracker::Options{.latency_s = 100}));
    EXPECT_FALSE(validate(GazeTracker::Options{.suppressed_s = -1}));
    EXPECT_TRUE(validate(GazeTracker::Options()));
}

// S'(e) = S(max(0, e - margin)), everywhere.
TEST(GazeTest, WidenedTablesSeeAsTheGazeMightBe) {
    const CsfTable& table = CsfTable::standard();
    const CsfTable wide = table.widened(Degrees(4));
    for (const double f : {0.5, 2.0, 8.0, 20.0})
        for (const double e : {0.0, 1.0, 3.9, 4.0, 5.0, 9.0, 24.0, 60.0})
            for (const double l : {0.1, 50.0}) {
                const double expected =
                    table.sensitivity(CyclesPerDegree(f), Degrees(std::max(0.0, e - 4)), Luminance(l));
                EXPECT_NEAR(wide.sensitivity(CyclesPerDegree(f), Degrees(e), Luminance(l)) / expected, 1, 1e-9)
                    << f << " " << e;
                EXPECT_GE(wide.highest_visible_frequency(0.1, Degrees(e), Luminance(l)).value() * (1 + 1e-6),
                          table.highest_visible_frequency(0.1, Degrees(e), Luminance(l)).value());
            }
    WidenedTables tables(table);
    EXPECT_EQ(tables.at(Degrees(3.5)), tables.at(Degrees(4)));
    EXPECT_NE(tables.at(Degrees(3.5)), tables.at(Degrees(3)));
    EXPECT_EQ(tables.at(Degrees(90)), nullptr);
    EXPECT_EQ(tables.at(Degrees(std::numeric_limits<double>::quiet_NaN())), nullptr);
    EXPECT_NEAR(tables.at(Degrees(3.5))->sensitivity(CyclesPerDegree(4), Degrees(10), Luminance(50)),
                table.sensitivity(CyclesPerDegree(4), Degrees(6), Luminance(50)), 1e-9);
}

// Of two frequencies and one luminance; the lower frequency's sensitivities are as given.
CsfTable table_over(std::vector<double> eccentricities, const std::vector<double>& sensitivities) {
    CsfSamples samples{"test", {1, 2}, std::move(eccentricities), {50}, {}};
    for (const double s : sensitivities) samples.sensitivity.insert(samples.sensitivity.end(), {s, s / 2});
    auto table = CsfTable::create(std::move(samples));
    EXPECT_TRUE(table) << table.error().message;
    return std::move(*table);
}
double seen(const CsfTable& table, double eccentricity) {
    return table.sensitivity(CyclesPerDegree(1), Degrees(eccentricity), Luminance(50));
}

TEST(GazeTest, WidenedTablesEndWhereNothingIsFartherAside) {
    const CsfTable falling = table_over({0, 20, 60, 170}, {200, 100, 10, 1});
    const CsfTable wide = falling.widened(head_only_margin); // 170 + 15 degrees are none
    EXPECT_EQ(wide.samples().eccentricity_deg, (std::vector<double>{0, 15, 35, 75}));
    for (const double e : {0.0, 15.0, 35.0, 75.0})
        EXPECT_NEAR(seen(wide, e), seen(falling, std::max(0.0, e - 15)), 1e-9) << e;
    EXPECT_NEAR(seen(wide, 180), 10, 1e-9) << "sees more than it would at 165 degrees";
    // A viewer who sees better far aside must not lose that.
    EXPECT_NEAR(seen(table_over({0, 20, 60, 170}, {200, 100, 10, 20}).widened(Degrees(15)), 180), 20, 1e-9);
    // As far as a margin goes, and beyond.
    for (const double margin : {120.0, 179.99, 180.0, 1e300, std::numeric_limits<double>::infinity(), std::nan("")})
        EXPECT_NEAR(seen(falling.widened(Degrees(margin)), 100), 200, 1e-9) << margin;
}

TEST(GazeTest, MarginsAreAtLeastAsLargeAsATablesSteps) {
    const CsfTable table = table_over({0, 20}, {200, 100});
    for (const double margin : {1e-300, 5e-5, 1e-4}) {
        const CsfTable wide = table.widened(Degrees(margin));
        EXPECT_NEAR(wide.samples().eccentricity_deg[1], 1e-4, 1e-12);
        EXPECT_GE(seen(wide, 10), seen(table, 10));
    }
    EXPECT_EQ(table.widened(Degrees(0)).samples().eccentricity_deg, table.samples().eccentricity_deg);
    // Steps that are just large enough lose that to the sum's rounding.
    const CsfTable fine = table_over({0, 1e-4, 20}, {200, 300, 100});
    ASSERT_LT((15 + 1e-4) - 15, 1e-4);
    EXPECT_GE(seen(fine.widened(Degrees(15)), 15), 300 * (1 - 1e-9));
}

} // namespace unseen::perception::gaze_test
