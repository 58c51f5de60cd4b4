// The observers of <perception/person.h> against what people were measured to see.
#include <calibration/people.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <perception/change.h>
#include <perception/judge.h>
#include <perception/person.h>

namespace unseen::calibration {
namespace {

using perception::CsfModel;
using perception::Stimulus;
using ::testing::HasSubstr;

const std::vector<MeasuredSensitivity>& people() {
    static const auto all = within_domain(*read_sensitivities("data/people/achromatic_thresholds.csv"));
    return all;
}

constexpr auto castle = [](const Stimulus& s) { return sensitivity(CsfModel::castle, s); };

TEST(People, AreHeldAgainstEightStudies) {
    EXPECT_EQ(read_sensitivities("data/people/achromatic_thresholds.csv")->size(), 699u);
    EXPECT_EQ(people().size(), 253u);
}

// What <perception/person.h> says of each, to the digits that it gives.
TEST(People, SeeMoreThanEachObserverAsOftenAsItSays) {
    for (const perception::Person& person : perception::people) {
        const auto compared = compare(people(), [&](const Stimulus& s) { return person.gain * castle(s); });
        EXPECT_NEAR(compared.share_above, person.share_above, 0.0005) << person.name;
    }
    EXPECT_LE(perception::default_person.share_above, 0.1);
    EXPECT_LE(perception::strict_person.share_above, 0.05);
}

// Its law of area is what makes castleCSF fit: with one patch for all, people differ from it twice as much.
TEST(People, ObeyTheLawOfArea) {
    const Comparison with = compare(people(), castle), without = compare(people(), [](Stimulus s) {
                                                           s.area = perception::patch_area(s.frequency);
                                                           return castle(s);
                                                       });
    EXPECT_LT(std::abs(with.median_db), 1.5);
    EXPECT_LT(with.deviation_db, 4.6);
    EXPECT_GT(without.deviation_db, 8);
}

// A picture of each grating, at the contrast at which people just saw it.
double seen_at_threshold(const MeasuredSensitivity& measured) {
    const Stimulus& s = measured.stimulus;
    const double cpd = s.frequency.value(), sigma = std::sqrt(s.area.value() / std::numbers::pi); // degrees
    constexpr double sigmas = 6, most_pixels = 400;
    const double ppd = std::max(2.5 * cpd, std::min(std::max(4 * cpd, 8.0), most_pixels / (sigmas * sigma)));
    const int side = static_cast<int>(sigmas * sigma * ppd) + 16;
    perception::JudgeOptions options;
    set_pixels_per_degree(options.display, perception::PixelsPerDegree(ppd));
    const double aside = std::tan(s.eccentricity.value() * std::numbers::pi / 180) * options.display.distance.value() /
                         options.display.pixel_pitch.value();
    if (s.eccentricity.value() > 0) options.gaze_px = glm::dvec2(0.5 * side + aside, 0.5 * side);
    perception::Image flat{side, side, 1, {}};
    flat.values.assign(static_cast<std::size_t>(side) * static_cast<std::size_t>(side),
                       static_cast<float>(s.luminance.value()));
    perception::Image grating = flat;
    for (int y = 0; y < side; ++y) {
        for (int x = 0; x < side; ++x) {
            const double dx = (x - 0.5 * side) / ppd, dy = (y - 0.5 * side) / ppd;
            const double envelope = std::exp(-(dx * dx + dy * dy) / (2 * sigma * sigma));
            const double wave = std::cos(2 * std::numbers::pi * cpd * dx);
            grating.at(x, y) *= static_cast<float>(1 + envelope * wave / measured.sensitivity);
        }
    }
    options.gain = perception::median_person.gain;
    return judge_modern(flat, grating, options)->max_ratio;
}

TEST(People, AtTheirThresholdsAreWhereTheMedianJudgeIs) {
    std::vector<double> seen;
    for (std::size_t i = 0; i < people().size(); i += 2) seen.push_back(seen_at_threshold(people()[i]));
    std::sort(seen.begin(), seen.end());
    EXPECT_NEAR(seen[seen.size() / 2], 1, 0.1);
    const auto missed = std::count_if(seen.begin(), seen.end(), [](double v) { return v < 0.5; });
    EXPECT_LE(static_cast<double>(missed) / static_cast<double>(seen.size()), 0.1); // people who see twice as much
}

// A Gabor patch that flickers, by elaTCSF's law of pooling. Gratings' bright and dark bars both count.
double flicker_sensitivity_to(const Stimulus& s) {
    constexpr double pooling = 3.80022, pooled_deg2 = 6.52801;
    constexpr int rings = 60, turns = 16;
    const double sigma = std::sqrt(s.area.value() / std::numbers::pi), radius = std::min(3 * sigma, 60.0);
    double sum = 0;
    for (int i = 0; i < rings; ++i) {
        const double ring = (i + 0.5) / rings * radius;
        for (int j = 0; j < turns; ++j) {
            const double turn = 2 * std::numbers::pi * (j + 0.5) / turns;
            const double x = ring * std::cos(turn), y = ring * std::sin(turn);
            const double degrees = std::min(std::hypot(s.eccentricity.value() + x, y), 90.0);
            const double contrast = std::exp(-ring * ring / (2 * sigma * sigma)) *
                                    std::abs(std::cos(2 * std::numbers::pi * s.frequency.value() * x));
            sum += std::pow(contrast *
                                perception::flicker_sensitivity(s.temporal, perception::Degrees(degrees), s.luminance),
                            pooling) *
                   ring * (radius / rings) * (2 * std::numbers::pi / turns);
        }
    }
    return std::pow(sum / pooled_deg2, 1 / pooling) * perception::flicker_share(s.frequency);
}

// What the judge of changes rests on (<perception/change.h>): coarse gratings are seen much better while they flicker,
// and the judge sees that, with a margin of 4 dB. As medians over people, in decibels.
TEST(People, SeeCoarseFlickerBetterThanWhatStandsStill) {
    std::vector<MeasuredSensitivity> flickering = *read_sensitivities("data/people/achromatic_thresholds.csv");
    std::erase_if(flickering, [](const MeasuredSensitivity& m) {
        const double hz = m.stimulus.temporal.value();
        return !(m.stimulus.frequency.value() < 1 && hz >= 4 && hz <= 10 && m.stimulus.luminance.value() >= 1);
    });
    ASSERT_EQ(flickering.size(), 25u);
    const Comparison still = compare(flickering, [](Stimulus s) {
        s.temporal = perception::Hertz(0);
        return castle(s);
    });
    EXPECT_NEAR(still.median_db, 9.7, 1);
    EXPECT_NEAR(compare(flickering, [](const Stimulus& s) { return flicker_sensitivity_to(s); }).median_db, -4, 1.5);
}

TEST(People, OfEachStudyCountAlike) {
    const auto table =
        parse_sensitivities("sensitivity,dataset,frequency_cpd,temporal_hz,eccentricity_deg,luminance_cdm2,area_deg2\n"
                            "# three of one study, one of another\n"
                            "10,a,1,0,0,20,1\n20,a,1,0,0,20,1\n30,a,1,0,0,20,1\r\n40,b,1,0,0,20,1\n",
                            "table");
    ASSERT_TRUE(table) << table.error().message;
    EXPECT_NEAR(compare(*table, [](const Stimulus&) { return 35.0; }).share_above, 0.5, 1e-12);
    EXPECT_NEAR(compare(*table, [](const Stimulus&) { return 25.0; }).share_above, 0.5 + 0.5 / 3, 1e-12);
    EXPECT_NEAR(gain_for_share(
                    *table, [](const Stimulus&) { return 10.0; }, 0.5),
                4, 1e-9);
}

TEST(People, AreReadWithErrorsThatNameTheLine) {
    const std::string header =
        "dataset,frequency_cpd,temporal_hz,eccentricity_deg,luminance_cdm2,area_deg2,sensitivity\n";
    const auto message = [](const std::string& text) {
        const auto read = parse_sensitivities(text, "t.csv");
        return read ? std::string() : read.error().message;
    };
    EXPECT_THAT(message(""), HasSubstr("columns' names"));
    EXPECT_THAT(message("a,b\n"), HasSubstr("t.csv:1: there is no column dataset"));
    EXPECT_THAT(message(header + "x,1,0,0,20,1\n"), HasSubstr("t.csv:2: there are only 6 fields"));
    EXPECT_THAT(message(header + "x,1,0,0,20,1,nan\n"), HasSubstr("sensitivity must be a number above 0"));
    EXPECT_THAT(message(header + "x,0,0,0,20,1,5\n"), HasSubstr("frequency_cpd"));
    EXPECT_THAT(message(header + "x,1,-1,0,20,1,5\n"), HasSubstr("temporal_hz must be a number of 0 or more"));
}

TEST(People, HaveNames) {
    EXPECT_EQ(perception::person("strict")->gain, perception::strict_person.gain);
    EXPECT_THAT(perception::person("me").error().message, HasSubstr("median, default, strict"));
}

} // namespace
} // namespace unseen::calibration
