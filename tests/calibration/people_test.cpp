// The observers of <unseen/perception/csf.h> against what people were measured to see.
#include <unseen/calibration/internal/people.h>

#include <unseen/perception/csf.h>
#include <unseen/perception/judge.h>

#include "change/flicker.h"
#include "judge/band_weights.h"
#include "testing.h"

namespace unseen::calibration::people_test {

using perception::CsfModel;
using perception::Stimulus;

const std::vector<MeasuredSensitivity>& people() {
    static const auto all = within_domain(*read_sensitivities("data/people/achromatic_thresholds.csv"));
    return all;
}

constexpr auto castle = [](const Stimulus& s) { return sensitivity(CsfModel::castle, s); };

TEST(People, AreHeldAgainstEightStudies) {
    EXPECT_EQ(read_sensitivities("data/people/achromatic_thresholds.csv")->size(), 699u);
    EXPECT_EQ(people().size(), 253u);
}

// What <unseen/perception/csf.h> says of each, to the digits that it gives.
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

// Of still gratings, as some were shown at up to 1 Hz.
double barten_of(CsfModel model, Stimulus s) {
    s.temporal = perception::Hertz(0);
    return sensitivity(model, s);
}
constexpr auto barten = [](const Stimulus& s) { return barten_of(CsfModel::barten_fitted, s); };

// The gains of <unseen/perception/csf.h>: of Barten's, as large a share of people lies above as of castleCSF's.
TEST(People, SeeMoreThanEachObserverOfBartensAsOften) {
    for (const perception::Person& person : perception::people) {
        constexpr double digits = 0.005; // of three and of the steps between single sensitivities
        EXPECT_NEAR(person.barten_gain / gain_for_share(people(), barten, person.share_above), 1, digits)
            << person.name;
    }
    const Comparison compared = compare(people(), barten);
    EXPECT_NEAR(compared.deviation_db, 4.42, 0.01); // castleCSF's is 4.44
    const Comparison usual = compare(people(), [](const Stimulus& s) { return barten_of(CsfModel::barten_1999, s); });
    EXPECT_GT(usual.deviation_db, 5.2);
}

TEST(People, FitBartensConstants) {
    const perception::BartenConstants fit = fit_barten(people()), &used = perception::fitted_barten;
    constexpr double close = 0.01; // of each: the valley is flat
    EXPECT_NEAR(fit.signal_to_noise / used.signal_to_noise, 1, close);
    EXPECT_NEAR(fit.line_spread / used.line_spread, 1, close);
    EXPECT_NEAR(fit.inhibition / used.inhibition, 1, close);
    EXPECT_NEAR(fit.greatest_cycles / used.greatest_cycles, 1, close);
}

// The fall with eccentricity that sensitivity() gives Barten's model, Geisler and Perry's, keeps four times too much far
// aside. So the judge takes castleCSF's.
TEST(People, FarAsideSeeAsCastleFallsAndNotAsGeislerAndPerrySay) {
    std::vector<MeasuredSensitivity> aside;
    for (const MeasuredSensitivity& m : people())
        if (m.stimulus.eccentricity.value() > 15) aside.push_back(m);
    ASSERT_EQ(aside.size(), 12u);
    EXPECT_NEAR(compare(aside, barten).median_db, 0, 3);
    EXPECT_LT(compare(aside, [](const Stimulus& s) { return barten_of(CsfModel::barten_1999, s); }).median_db, -9);
}

// A picture of each grating, at the contrast at which people just saw it.
struct Pictures {
    perception::Image flat, grating;
    perception::JudgeOptions options;
};
Pictures pictures_of(const MeasuredSensitivity& measured) {
    const Stimulus& s = measured.stimulus;
    const double cpd = s.frequency.value(), radius = std::sqrt(s.area.value() / std::numbers::pi); // degrees
    // These studies' gratings fade as Gaussians, whose area is pi sigma^2; the others' end at an edge.
    const bool fades =
        measured.study == "modelfest" || measured.study == "snowden1995" || measured.study == "hdrvdp_csf";
    constexpr double usual_pixels = 400, samples_a_cycle = 4, least_ppd = 8;
    const double reach = (fades ? 3 : 1.2) * radius; // degrees
    const double ppd = std::max(samples_a_cycle * cpd,
                                std::min(std::max(2 * samples_a_cycle * cpd, least_ppd), usual_pixels / (2 * reach)));
    const int side = static_cast<int>(2 * reach * ppd) + 16;
    Pictures p;
    set_pixels_per_degree(p.options.display, perception::PixelsPerDegree(ppd));
    const double aside = std::tan(s.eccentricity.value() * std::numbers::pi / 180) *
                         p.options.display.distance.value() / p.options.display.pixel_pitch.value();
    if (s.eccentricity.value() > 0) p.options.gaze_px = glm::dvec2(0.5 * side + aside, 0.5 * side);
    p.flat = {side, side, 1, {}};
    p.flat.values.assign(static_cast<std::size_t>(side) * static_cast<std::size_t>(side),
                         static_cast<float>(s.luminance.value()));
    p.grating = p.flat;
    for (int y = 0; y < side; ++y) {
        for (int x = 0; x < side; ++x) {
            const double dx = (x - 0.5 * side) / ppd, dy = (y - 0.5 * side) / ppd, r = std::hypot(dx, dy);
            const double envelope = fades ? std::exp(-r * r / (2 * radius * radius))
                                          : std::clamp((radius - r) * ppd + 0.5, 0.0, 1.0); // of the edge's pixels
            const double wave = std::cos(2 * std::numbers::pi * cpd * dx);
            p.grating.at(x, y) *= static_cast<float>(1 + envelope * wave / measured.sensitivity);
        }
    }
    return p;
}

// V of all gratings by a judge for the median person.
struct Seen {
    double median = 0;
    double share_below_half = 0;
    // Of the gratings, each study counting alike, that the judge for a person with so many times the gain misses.
    double missed_by(double gain) const {
        double share = 0;
        for (const auto& [v, weight] : all) share += v * gain < 1 ? weight : 0;
        return share;
    }
    struct One {
        double v, weight;
    };
    std::vector<One> all;
};
Seen seen_by(const perception::JudgeOptions& judge) {
    std::map<std::string, int> counts;
    for (const MeasuredSensitivity& m : people()) ++counts[m.study];
    Seen seen;
    for (const MeasuredSensitivity& m : people()) {
        Pictures p = pictures_of(m);
        p.options.csf = judge.csf, p.options.gain = judge.gain, p.options.beta = judge.beta;
        const double v = judge_modern(p.flat, p.grating, p.options)->max_ratio;
        seen.all.push_back({v, 1.0 / counts[m.study] / static_cast<double>(counts.size())});
        seen.share_below_half += (v < 0.5) / static_cast<double>(people().size());
    }
    std::sort(seen.all.begin(), seen.all.end(), [](const auto& a, const auto& b) { return a.v < b.v; });
    seen.median = seen.all[seen.all.size() / 2].v;
    return seen;
}

// castleCSF itself, without any judge, comes to 0.88 in the median, and to 10% below a half: people who see twice as
// much as the median person, and most of one study.
TEST(People, AtTheirThresholdsAreWhereTheMedianJudgeIs) {
    const Seen seen = seen_by({.gain = perception::median_person.gain});
    EXPECT_NEAR(seen.median, 1, 0.1);
    EXPECT_LE(seen.share_below_half, 0.1);
    for (const perception::Person& person : perception::people)
        EXPECT_LE(seen.missed_by(person.gain), person.share_above) << person.name;
}

TEST(People, AtTheirThresholdsAreNearTheSecondJudge) {
    const Seen seen = seen_by(perception::second_judge_options(perception::median_person));
    EXPECT_NEAR(seen.median, 1, 0.12); // it is 0.90
    EXPECT_LE(seen.share_below_half, 0.135);
    for (const perception::Person& person : perception::people)
        EXPECT_LE(seen.missed_by(person.barten_gain / perception::median_person.barten_gain), person.share_above)
            << person.name;
}

// A Gabor patch that flickers, by elaTCSF's law of pooling. Gratings' bright and dark bars both count.
double flicker_sensitivity_to(const Stimulus& s) {
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
            sum +=
                std::pow(contrast * perception::flicker_sensitivity(s.temporal.value(), degrees, s.luminance.value()),
                         perception::flicker_pooling) *
                ring * (radius / rings) * (2 * std::numbers::pi / turns);
        }
    }
    double share = 0;
    for (const perception::FlickerBlur& blur : perception::flicker_blurs)
        share += blur.weight * std::exp(-std::pow(s.frequency.value() / blur.cpd, 2));
    return std::pow(sum / perception::flicker_pooling_deg2, 1 / perception::flicker_pooling) * share;
}

// What the judge of changes rests on (change/flicker.h): coarse gratings are seen much better while they flicker,
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
        return read ? "" : read.error().message;
    };
    EXPECT_THAT(message(""), HasSubstr("columns' names"));
    EXPECT_THAT(message("a,b\n"), HasSubstr("t.csv:1: there is no column dataset"));
    EXPECT_THAT(message("sensitivity," + header + "1,x,1,0,0,20,1,5\n"),
                HasSubstr("column sensitivity is there twice"));
    EXPECT_THAT(message(header + "x,1,0,0,20,1\n"), HasSubstr("t.csv:2: there are only 6 fields"));
    EXPECT_THAT(message(header + "x,1,0,0,20,1,nan\n"), HasSubstr("sensitivity must be a number above 0"));
    EXPECT_THAT(message(header + "x,0,0,0,20,1,5\n"), HasSubstr("frequency_cpd"));
    EXPECT_THAT(message(header + "x,1,-1,0,20,1,5\n"), HasSubstr("temporal_hz must be a number of 0 or more"));
}

TEST(People, HaveNames) {
    EXPECT_EQ(perception::person("strict")->gain, perception::strict_person.gain);
    EXPECT_THAT(perception::person("me").error().message, HasSubstr("median, default, strict"));
}

} // namespace unseen::calibration::people_test
