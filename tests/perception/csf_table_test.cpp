// The table: how near it comes to the closed form, how it interpolates, and that its conservative form is monotone and
// inverted exactly.
#include <unseen/perception/csf.h>
#include <unseen/perception/internal/motion.h>

#include "testing.h"

namespace unseen::perception::csf_table_test {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();
// Relative, what the table promises wherever S > 1.
constexpr double table_accuracy = 0.005;
// Relative; some ten operations in double on logarithms of up to 500.
constexpr double rounding = 1e-11;
// Relative; the monotone form keeps logarithms of up to 500 in float, most of them below 10.
constexpr double float_rounding = 1e-5;

struct Place {
    double cpd, degrees, cdm2;
};

class RandomPlaces {
public:
    explicit RandomPlaces(unsigned seed) : engine_(seed) {}
    double uniform(double low, double high) { return std::uniform_real_distribution<>(low, high)(engine_); }
    // Within the table's axes, half of them within 25 degrees, where most is visible.
    Place next() {
        return {std::exp2(uniform(-4, 6)), uniform(0, 1) < 0.5 ? uniform(0, 25) : uniform(0, 120),
                std::pow(10, uniform(-3, 4))};
    }

private:
    std::mt19937 engine_;
};

double closed_form(CsfModel model, const Place& p) {
    return sensitivity(model, {.frequency = CyclesPerDegree(p.cpd),
                               .luminance = Luminance(p.cdm2),
                               .eccentricity = Degrees(p.degrees),
                               .area = patch_area(CyclesPerDegree(p.cpd))});
}
double interpolated(const CsfTable& t, const Place& p) {
    return t.sensitivity(CyclesPerDegree(p.cpd), Degrees(p.degrees), Luminance(p.cdm2));
}
double monotone(const CsfTable& t, const Place& p) {
    return t.monotone_sensitivity(CyclesPerDegree(p.cpd), Degrees(p.degrees), Luminance(p.cdm2));
}
double inverse(const CsfTable& t, double contrast, double degrees, double cdm2) {
    return t.highest_visible_frequency(contrast, Degrees(degrees), Luminance(cdm2)).value();
}

// Two of everything: S = 1/cpd at the fovea and 100 cd/m2, a tenth of it 10 degrees out, a quarter in dimmer light.
CsfSamples small_samples() {
    return {.source = "made up",
            .frequency_cpd = {1, 4, 16},
            .eccentricity_deg = {0, 10},
            .luminance_cdm2 = {1, 100},
            .sensitivity = {16, 4, 1, 64, 16, 4, 1.6, 0.4, 0.1, 6.4, 1.6, 0.4}};
}
CsfTable create(CsfSamples samples) {
    auto table = CsfTable::create(std::move(samples));
    EXPECT_TRUE(table) << table.error().message;
    return *std::move(table);
}

// A measured table as it may come: noisy, uneven, and monotone nowhere; over eccentricity as noisy as may be.
CsfTable noisy_table(unsigned seed) {
    RandomPlaces random(seed);
    CsfSamples s;
    s.source = "noise";
    for (double cpd = 0.3; cpd < 40; cpd *= random.uniform(1.01, 1.9)) s.frequency_cpd.push_back(cpd);
    for (double degrees = 0; degrees < 70; degrees += random.uniform(0.01, 15)) s.eccentricity_deg.push_back(degrees);
    for (double cdm2 = 0.1; cdm2 < 2000; cdm2 *= random.uniform(1.01, 6)) s.luminance_cdm2.push_back(cdm2);
    const std::size_t plane = s.frequency_cpd.size() * s.luminance_cdm2.size();
    for (std::size_t i = 0; i < plane; ++i) s.sensitivity.push_back(std::pow(10, random.uniform(-2, 3)));
    std::vector<double> least(s.sensitivity);
    for (std::size_t i = plane; i < plane * s.eccentricity_deg.size(); ++i) {
        double& nearer = least[i % plane];
        s.sensitivity.push_back(nearer * std::pow(10, random.uniform(-0.2, 0.99 * CsfTable::noise_db / 20)));
        nearer = std::min(nearer, s.sensitivity.back());
    }
    return create(std::move(s));
}

TEST(CsfTable, IsWithinHalfAPercentOfTheClosedForm) {
    const Stimulus all_conditions[] = {
        {},
        {.temporal = Hertz(2)},
        {.temporal = Hertz(8)},
        {.temporal = Hertz(30)},
        {.velocity = DegreesPerSecond(0.5)},
        {.velocity = DegreesPerSecond(20)},
        {.field = VisualField::nasal},
        {.field = VisualField::temporal, .velocity = DegreesPerSecond(3)},
        {.temporal = Hertz(5), .distance = Metres(3)},
    };
    for (const CsfModel model : csf_models) {
        for (const Stimulus& conditions : all_conditions) {
            const bool knows_fields = name(model).starts_with("castle") || model == CsfModel::stela;
            if (!knows_fields && conditions.field != VisualField::worst) continue;
            const auto table = require(CsfTable::from_model(model, conditions));
            RandomPlaces random(1);
            int checked = 0;
            for (int i = 0; i < 8000; ++i) {
                const Place p = random.next();
                const double s = sensitivity(
                    model, stimulus_of(conditions, CyclesPerDegree(p.cpd), Degrees(p.degrees), Luminance(p.cdm2)));
                if (!(s > 1)) continue;
                ++checked;
                ASSERT_NEAR(interpolated(*table, p) / s, 1, table_accuracy)
                    << table->samples().source << ": " << p.cpd << " cpd, " << p.degrees << " deg, " << p.cdm2;
                ASSERT_GT(monotone(*table, p), s * (1 - table_accuracy))
                    << table->samples().source << ": " << p.cpd << " cpd, " << p.degrees << " deg, " << p.cdm2;
            }
            EXPECT_GT(checked, 200) << table->samples().source;
        }
    }
}

TEST(CsfTable, IsWithinHalfAPercentWhereTheFormsHaveKinks) {
    // castle's plateau, which ends at 0.61 of the sustained channel's peak frequency; its transient channel's floor at
    // 0.0182 cd/m2; and the crossing of daly's branches, at any eccentricity.
    RandomPlaces random(5);
    for (const double hertz : {0.0, 2.0, 8.0}) {
        const Stimulus conditions{.temporal = Hertz(hertz)};
        const auto castle = CsfTable::from_model(CsfModel::castle, conditions);
        const auto daly = CsfTable::from_model(CsfModel::daly, conditions);
        ASSERT_TRUE(castle && daly);
        for (int i = 0; i < 20000; ++i) {
            const double cdm2 =
                i % 2 ? 0.0182 * std::pow(10, random.uniform(-0.5, 1)) : std::pow(10, random.uniform(-3, 4));
            const double plateau_end = 0.611 * 1.78119 * std::pow(1 + 91.5718 / cdm2, -0.256682);
            const double degrees = random.uniform(0, 100);
            const Place near_plateau{std::max(plateau_end * std::exp2(random.uniform(-0.1, 0.1)), 1.0 / 16),
                                     degrees / 10, cdm2};
            const Place near_crossing{4 / std::sqrt(1 + 0.24 * degrees) * std::exp2(random.uniform(-1.5, 1.5)), degrees,
                                      cdm2};
            for (const auto& [model, table, p] : {std::tuple{CsfModel::castle, &*castle, near_plateau},
                                                  std::tuple{CsfModel::daly, &*daly, near_crossing}}) {
                const double s = sensitivity(
                    model, stimulus_of(conditions, CyclesPerDegree(p.cpd), Degrees(p.degrees), Luminance(p.cdm2)));
                if (!(s > 1)) continue;
                ASSERT_NEAR(interpolated(*table, p) / s, 1, table_accuracy)
                    << table->samples().source << ": " << p.cpd << " cpd, " << p.degrees << " deg, " << p.cdm2;
            }
        }
    }
}

TEST(CsfTable, RefusesConditionsOutsideOfTheDomain) {
    const Stimulus bad[] = {
        {.temporal = Hertz(-1)},
        {.temporal = Hertz(infinity)},
        {.temporal = Hertz(not_a_number)},
        {.velocity = DegreesPerSecond(-1)},
        {.velocity = DegreesPerSecond(not_a_number)},
        {.temporal = Hertz(8), .velocity = DegreesPerSecond(1)},
        {.distance = Metres(0)},
    };
    for (const Stimulus& conditions : bad)
        EXPECT_THAT(error_in(CsfTable::from_model(CsfModel::castle, conditions)),
                    testing::AllOf(HasSubstr("velocity"), HasSubstr("Hz")));
}

TEST(CsfTable, BlackCountsAsTheLowestLuminance) {
    const CsfTable& table = CsfTable::standard();
    for (const double black : {0.0, 1e-300, 1e-5}) {
        EXPECT_EQ(interpolated(table, {2, 3, black}), interpolated(table, {2, 3, 1e-3}));
        EXPECT_EQ(monotone(table, {2, 3, black}), monotone(table, {2, 3, 1e-3}));
        EXPECT_EQ(inverse(table, 0.5, 3, black), inverse(table, 0.5, 3, 1e-3));
    }
}

TEST(CsfTable, UnderflowInThePeripheryLeavesTheFoveaAlone) {
    // The nasal red-green branch loses 11.6 decades a degree at 64 cpd: by 27 degrees no double holds it.
    const auto table = require(CsfTable::from_model(CsfModel::castle_red_green, {.field = VisualField::nasal}));
    const Stimulus s = stimulus_of({.field = VisualField::nasal}, CyclesPerDegree(40), Degrees(2), Luminance(100));
    EXPECT_NEAR(interpolated(*table, {40, 2, 100}) / sensitivity(CsfModel::castle_red_green, s), 1, table_accuracy);
    EXPECT_GT(interpolated(*table, {64, 120, 100}), 0);
}

TEST(CsfTable, IsExactAtItsSamples) {
    const CsfTable& table = CsfTable::standard();
    const CsfSamples& s = table.samples();
    for (std::size_t e = 0; e < s.eccentricity_deg.size(); ++e) {
        for (std::size_t l = 0; l < s.luminance_cdm2.size(); l += 5) {
            for (std::size_t f = 0; f < s.frequency_cpd.size(); f += 7) {
                const Place p{s.frequency_cpd[f], s.eccentricity_deg[e], s.luminance_cdm2[l]};
                const double stored = s.sensitivity[(e * s.luminance_cdm2.size() + l) * s.frequency_cpd.size() + f];
                EXPECT_NEAR(interpolated(table, p) / stored, 1, rounding);
                EXPECT_NEAR(closed_form(CsfModel::castle, p) / stored, 1, rounding);
            }
        }
    }
}

TEST(CsfTable, MonotoneFormIsTightAboveThePeak) {
    const CsfTable& table = CsfTable::standard();
    RandomPlaces random(3);
    for (int i = 0; i < 300; ++i) {
        const Place p{std::exp2(random.uniform(-2, 5)), random.uniform(0, 40), std::pow(10, random.uniform(0, 2))};
        double largest = 0; // over this and all higher frequencies, this and all lower luminances
        for (double cdm2 = p.cdm2; cdm2 > 0.3 * p.cdm2; cdm2 *= 0.8) {
            for (double cpd = p.cpd; cpd < 64; cpd *= 1.01)
                largest = std::max(largest, closed_form(CsfModel::castle, {cpd, p.degrees, cdm2}));
        }
        if (!(largest > 1)) continue;
        EXPECT_NEAR(monotone(table, p) / largest, 1, table_accuracy);
    }
}

TEST(CsfTable, InterpolatesLogarithmsLinearly) {
    const CsfTable table = create(small_samples());
    EXPECT_NEAR(interpolated(table, {2, 0, 1}), 8, 8 * rounding);
    EXPECT_NEAR(interpolated(table, {1, 5, 1}), 16 / std::sqrt(10), 16 * rounding);
    EXPECT_NEAR(interpolated(table, {1, 0, 10}), 32, 32 * rounding);
    EXPECT_NEAR(interpolated(table, {2, 5, 10}), 16 / std::sqrt(10), 16 * rounding);
}

TEST(CsfTable, ClampsOutsideOfItsAxes) {
    const CsfTable table = create(small_samples());
    EXPECT_NEAR(interpolated(table, {0.1, -5, 0.01}), 16, 16 * rounding);
    EXPECT_NEAR(interpolated(table, {100, 50, 1e9}), 0.4, rounding);
    EXPECT_NEAR(interpolated(table, {0, infinity, infinity}), 6.4, 10 * rounding);
    EXPECT_TRUE(std::isnan(interpolated(table, {not_a_number, 0, 1})));
    EXPECT_TRUE(std::isnan(interpolated(table, {1, not_a_number, 1})));
    EXPECT_TRUE(std::isnan(interpolated(table, {1, 0, not_a_number})));
    EXPECT_TRUE(std::isnan(interpolated(table, {1, 0, -1})));
    EXPECT_TRUE(std::isnan(monotone(table, {1, not_a_number, 1})));
}

TEST(CsfTable, MonotoneFormTakesTheLargestOfWhatIsHarderToSee) {
    CsfSamples s = small_samples();
    s.sensitivity = {4, 16, 1, 64, 16, 4, 1.6, 0.4, 2, 6.4, 1.6, 0.4};
    const CsfTable table = create(s);
    EXPECT_NEAR(monotone(table, {1, 0, 1}), 16, 16 * rounding);     // the peak, below the peak
    EXPECT_NEAR(monotone(table, {16, 0, 1}), 2, float_rounding);    // larger further out
    EXPECT_NEAR(monotone(table, {1, 10, 1}), 2, float_rounding);    // larger at a higher frequency
    EXPECT_NEAR(monotone(table, {16, 10, 100}), 2, float_rounding); // larger in dimmer light
    EXPECT_NEAR(table.peak_sensitivity(Degrees(0), Luminance(1)), 16, 16 * rounding);
}

TEST(CsfTable, MonotoneFormIsMonotone) {
    const std::vector<CsfTable> tables = {CsfTable::standard(), noisy_table(4), noisy_table(5), noisy_table(6)};
    RandomPlaces random(7);
    for (const CsfTable& table : tables) {
        for (int i = 0; i < 20000; ++i) {
            const Place p = random.next();
            const double s = monotone(table, p);
            Place other = p;
            other.cpd *= std::exp2(random.uniform(0, 3));
            ASSERT_LE(monotone(table, other), s * (1 + rounding));
            other = p;
            other.degrees += random.uniform(0, 1) < 0.5 ? random.uniform(0, 0.1) : random.uniform(0, 60);
            ASSERT_LE(monotone(table, other), s * (1 + rounding));
            other = p;
            other.cdm2 *= std::exp2(random.uniform(0, 4));
            ASSERT_GE(monotone(table, other), s * (1 - rounding));
            other = p;
            other.cpd = std::min(p.cpd, table.samples().frequency_cpd.back()); // beyond it only one of them falls
            ASSERT_GE(monotone(table, other), interpolated(table, other) * (1 - float_rounding));
        }
    }
}

TEST(CsfTable, HighestVisibleFrequencyIsMonotone) {
    const std::vector<CsfTable> tables = {CsfTable::standard(), noisy_table(8), noisy_table(9)};
    // Octaves: rounding of the sensitivity over the flattest slope that the tables are likely to have.
    constexpr double slack = 1e-6;
    RandomPlaces random(10);
    const auto octaves = [](double cpd) { return std::log2(cpd); };
    for (const CsfTable& table : tables) {
        for (int i = 0; i < 20000; ++i) {
            const Place p = random.next();
            const double contrast = std::pow(10, random.uniform(-3, 1));
            const double cpd = inverse(table, contrast, p.degrees, p.cdm2);
            ASSERT_FALSE(std::isnan(cpd));
            const double stronger = inverse(table, contrast * random.uniform(1.001, 2), p.degrees, p.cdm2);
            const double further = inverse(table, contrast, p.degrees + random.uniform(0.01, 20), p.cdm2);
            const double brighter = inverse(table, contrast, p.degrees, p.cdm2 * random.uniform(1.01, 20));
            EXPECT_GE(octaves(stronger), octaves(cpd) - slack);
            EXPECT_LE(octaves(further), octaves(cpd) + slack);
            EXPECT_GE(octaves(brighter), octaves(cpd) - slack);
        }
    }
}

TEST(CsfTable, InverseUndoesTheForwardWay) {
    const std::vector<CsfTable> tables = {CsfTable::standard(), CsfTable::from_model(CsfModel::stela), noisy_table(11)};
    RandomPlaces random(12);
    for (const CsfTable& table : tables) {
        for (int i = 0; i < 20000; ++i) {
            Place p = random.next();
            p.degrees /= 2;
            const double s = monotone(table, p);
            if (!(s > 1e-3)) continue;
            // A hair above the threshold, so that rounding cannot hide a whole plateau.
            const double contrast = (1 + 1e-9) / s;
            const double cpd = inverse(table, contrast, p.degrees, p.cdm2);
            ASSERT_GE(cpd, p.cpd * (1 - 1e-9)) << "visible here, so visible at least up to here";
            ASSERT_TRUE(std::isfinite(cpd));
            ASSERT_NEAR(monotone(table, {cpd, p.degrees, p.cdm2}) * contrast, 1, 1e-8);
            // Beyond it nothing is visible.
            ASSERT_LT(monotone(table, {cpd * 1.01, p.degrees, p.cdm2}) * contrast, 1);
        }
    }
}

TEST(CsfTable, InverseOfASmallTableByHand) {
    const CsfTable table = create(small_samples());
    EXPECT_NEAR(inverse(table, 1, 0, 1), 16, 1e-9);
    EXPECT_NEAR(inverse(table, 1 / 8.0, 0, 1), 2, 1e-9);
    EXPECT_NEAR(inverse(table, 1 / 16.0, 0, 1), 1, 1e-9);
    EXPECT_EQ(inverse(table, 1 / 16.1, 0, 1), 0);
    EXPECT_NEAR(inverse(table, 1 / 8.0, 0, 10), 4, 1e-9);
    // Past the last sample with the slope before it, 1/cpd; contrasts above 1 are allowed.
    EXPECT_NEAR(inverse(table, 2, 0, 1), 32, 32 * float_rounding);
    EXPECT_NEAR(monotone(table, {32, 0, 1}), 0.5, float_rounding);
}

TEST(CsfTable, PlateauGivesItsHighestFrequency) {
    CsfSamples s = small_samples();
    s.frequency_cpd = {1, 2, 4, 8};
    s.eccentricity_deg = {0};
    s.luminance_cdm2 = {100};
    s.sensitivity = {64, 16, 16, 4};
    EXPECT_NEAR(inverse(create(s), 1 / 16.0, 0, 100), 4, 1e-9);
    s.sensitivity = {64, 16, 16, 16};
    EXPECT_NEAR(inverse(create(s), 1 / 16.0, 0, 100), 8, 1e-9);
    s.sensitivity = {4, 64, 16, 4}; // the rising branch is clamped to the peak
    EXPECT_NEAR(inverse(create(s), 1 / 64.0, 0, 100), 2, 1e-9);
    EXPECT_EQ(inverse(create(s), 1 / 65.0, 0, 100), 0);
}

TEST(CsfTable, FlatTableHidesNothingAboveItsLevel) {
    CsfSamples s = small_samples();
    std::ranges::fill(s.sensitivity, 8);
    const CsfTable table = create(s);
    EXPECT_EQ(inverse(table, 0.5, 0, 100), infinity);
    EXPECT_EQ(inverse(table, 0.1, 0, 100), 0);
    EXPECT_NEAR(inverse(table, 1 / 8.0, 0, 100), 16, 1e-9);
}

TEST(CsfTable, BatchesAgreeWithSingleQueries) {
    RandomPlaces random(13);
    for (const CsfTable& table : {CsfTable::standard(), noisy_table(14)}) {
        for (const std::size_t count : {0u, 1u, 7u, 8u, 9u, 1000u}) {
            std::vector<float> contrast, degrees, cdm2, result(count, -1);
            for (std::size_t i = 0; i < count; ++i) {
                const Place p = random.next();
                contrast.push_back(static_cast<float>(std::pow(10, random.uniform(-3, 0.5))));
                degrees.push_back(static_cast<float>(p.degrees));
                cdm2.push_back(static_cast<float>(p.cdm2));
            }
            table.highest_visible_log2_frequency(contrast, degrees, cdm2, result);
            for (std::size_t i = 0; i < count; ++i) {
                const double cpd = inverse(table, contrast[i], degrees[i], cdm2[i]);
                if (cpd == 0 || std::isinf(cpd)) {
                    EXPECT_EQ(double(result[i]), std::log2(cpd));
                } else {
                    EXPECT_NEAR(result[i], std::log2(cpd), 1e-6 * std::max(1.0, std::abs(std::log2(cpd)))); // float
                }
            }
        }
    }
}

TEST(CsfTable, BatchesMayHoldBadValuesAnywhere) {
    const CsfTable& table = CsfTable::standard();
    constexpr float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
    const std::vector<float> contrast = {nan, 0.5f, 0.5f, 0.0f, inf, -1.0f, 0.5f, 0.5f, 0.5f};
    const std::vector<float> degrees = {0, nan, 0, 0, 0, 0, inf, -inf, 0};
    const std::vector<float> cdm2 = {100, 100, nan, 100, 100, 100, 100, 100, -1};
    std::vector<float> result(contrast.size(), 0);
    table.highest_visible_log2_frequency(contrast, degrees, cdm2, result);
    EXPECT_EQ(result[0], inf);
    EXPECT_EQ(result[1], inf);
    EXPECT_EQ(result[2], inf);
    EXPECT_EQ(result[3], -inf);
    EXPECT_EQ(result[4], inf);
    EXPECT_EQ(result[5], inf);
    EXPECT_EQ(result[6], -inf); // as at 120 degrees
    EXPECT_NEAR(result[7], std::log2(inverse(table, 0.5, 0, 100)), 1e-5);
    EXPECT_EQ(result[8], inf);
}

TEST(CsfTable, TakesOneEccentricityAndOneLuminance) {
    CsfSamples s = small_samples();
    s.eccentricity_deg = {0};
    s.luminance_cdm2 = {100};
    s.sensitivity = {64, 16, 4};
    const CsfTable table = create(s);
    EXPECT_NEAR(interpolated(table, {2, 70, 0.1}), 32, 32 * rounding);
    EXPECT_NEAR(inverse(table, 1 / 32.0, 70, 0.1), 2, 1e-9);
}

TEST(CsfTable, FindsItsWayOnVeryUnevenAxes) {
    // Clusters of samples far denser than the buckets of the search, between wide gaps.
    CsfSamples s;
    s.source = "uneven";
    s.frequency_cpd = {1, 64};
    for (const double start : {0.0, 3.0, 89.0}) {
        for (int i = 0; i < 40; ++i) s.eccentricity_deg.push_back(start + 0.0002 * i);
    }
    s.luminance_cdm2 = {100};
    for (std::size_t i = 0; i < s.eccentricity_deg.size(); ++i) {
        s.sensitivity.push_back(std::exp2(-double(i)));
        s.sensitivity.push_back(std::exp2(-double(i) - 6));
    }
    const CsfTable table = create(s);
    for (std::size_t i = 0; i + 1 < s.eccentricity_deg.size(); ++i) {
        for (const double share : {0.0, 0.25, 0.999}) {
            const double degrees = std::lerp(s.eccentricity_deg[i], s.eccentricity_deg[i + 1], share);
            EXPECT_NEAR(std::log2(interpolated(table, {1, degrees, 100})), -(double(i) + share), 1e-8);
        }
    }
}

TEST(CsfTable, RefusesBadSamplesAndNamesThem) {
    struct Case {
        const char* expected;
        std::function<void(CsfSamples&)> spoil;
    };
    const Case cases[] = {
        {"frequency_cpd needs two", [](CsfSamples& s) { s.frequency_cpd = {1}; }},
        {"frequency_cpd needs two", [](CsfSamples& s) { s.frequency_cpd.clear(); }},
        {"eccentricity_deg is empty", [](CsfSamples& s) { s.eccentricity_deg.clear(); }},
        {"luminance_cdm2 is empty", [](CsfSamples& s) { s.luminance_cdm2.clear(); }},
        {"frequency_cpd[0]", [](CsfSamples& s) { s.frequency_cpd[0] = 0; }},
        {"frequency_cpd[0]", [](CsfSamples& s) { s.frequency_cpd[0] = -1; }},
        {"frequency_cpd[1]", [](CsfSamples& s) { s.frequency_cpd[1] = not_a_number; }},
        {"frequency_cpd[2]", [](CsfSamples& s) { s.frequency_cpd[2] = infinity; }},
        {"frequency_cpd[2]", [](CsfSamples& s) { s.frequency_cpd[2] = 4; }},
        {"frequency_cpd[1]", [](CsfSamples& s) { s.frequency_cpd[1] = std::nextafter(1.0, 2.0); }},
        {"eccentricity_deg[1]", [](CsfSamples& s) { s.eccentricity_deg[1] = 0; }},
        {"eccentricity_deg[1]", [](CsfSamples& s) { s.eccentricity_deg[1] = not_a_number; }},
        {"eccentricity_deg[0]", [](CsfSamples& s) { s.eccentricity_deg[0] = -1; }},
        {"eccentricity_deg[0]", [](CsfSamples& s) { s.eccentricity_deg[0] = 2; }},
        {"frequency_cpd[2] must be at most", [](CsfSamples& s) { s.frequency_cpd[2] = 1e300; }},
        {"eccentricity_deg[1] must be at most", [](CsfSamples& s) { s.eccentricity_deg[1] = 1e300; }},
        {"luminance_cdm2[1] must be at most", [](CsfSamples& s) { s.luminance_cdm2[1] = 1e300; }},
        {"sensitivity[0][0][0]", [](CsfSamples& s) { s.sensitivity[0] = 1e300; }},
        {"luminance_cdm2[0]", [](CsfSamples& s) { s.luminance_cdm2[0] = 0; }},
        {"luminance_cdm2[1]", [](CsfSamples& s) { s.luminance_cdm2[1] = 0.5; }},
        {"2 x 2 x 3", [](CsfSamples& s) { s.sensitivity.pop_back(); }},
        {"2 x 2 x 3", [](CsfSamples& s) { s.sensitivity.push_back(1); }},
        {"2 x 2 x 3", [](CsfSamples& s) { s.sensitivity.clear(); }},
        {"sensitivity[0][0][0]", [](CsfSamples& s) { s.sensitivity[0] = 0; }},
        {"sensitivity[0][1][1]", [](CsfSamples& s) { s.sensitivity[4] = -1; }},
        {"sensitivity[1][0][2]", [](CsfSamples& s) { s.sensitivity[8] = not_a_number; }},
        {"sensitivity[1][1][2]", [](CsfSamples& s) { s.sensitivity[11] = infinity; }},
        {"summation must be from 0.01 to 100, but is 0.001", [](CsfSamples& s) { s.summation = 0.001; }},
        {"summation", [](CsfSamples& s) { s.summation = not_a_number; }},
    };
    for (const Case& bad : cases) {
        CsfSamples samples = small_samples();
        bad.spoil(samples);
        const auto table = CsfTable::create(samples);
        ASSERT_FALSE(table) << bad.expected;
        EXPECT_THAT(table.error().message, HasSubstr(bad.expected));
        EXPECT_EQ(table.error().code, ErrorCode::invalid_argument);
    }
}

// A table with its eccentricities in reverse, as a slip in a script makes it.
TEST(CsfTable, RefusesWhatGrowsWithEccentricityBeyondNoise) {
    CsfSamples samples = small_samples();
    std::rotate(samples.sensitivity.begin(), samples.sensitivity.begin() + 6, samples.sensitivity.end());
    const auto reversed = CsfTable::create(samples);
    ASSERT_FALSE(reversed);
    EXPECT_EQ(reversed.error().code, ErrorCode::invalid_argument);
    EXPECT_THAT(reversed.error().message,
                testing::AllOf(HasSubstr("sensitivity[1][0][0] is 16 (10 degrees, 1 cd/m2, 1 cpd)"),
                               HasSubstr("sensitivity[0][0][0] is 1.6 (0 degrees)"), HasSubstr("20 dB"),
                               HasSubstr("6.2 dB"), HasSubstr("in the order of the axes")));
    // What is compared is the least sensitive place nearer to the gaze, not only the neighbour.
    samples = small_samples();
    samples.eccentricity_deg = {0, 10, 20};
    samples.sensitivity = {16, 4, 1, 64, 16, 4, 1.6, 0.4, 0.1, 6.4, 1.6, 0.4, 3, 0.4, 0.1, 6.4, 1.6, 0.4};
    EXPECT_TRUE(CsfTable::create(samples));
    samples.eccentricity_deg = {0, 10, 20, 30};
    samples.sensitivity.insert(samples.sensitivity.end(), {5, 0.4, 0.1, 6.4, 1.6, 0.4});
    EXPECT_THAT(error_in(CsfTable::create(samples)),
                testing::AllOf(HasSubstr("sensitivity[3][0][0]"), HasSubstr("sensitivity[1][0][0]")));
}

TEST(CsfTable, NoiseIsNoReasonToRefuse) {
    const double noise = std::pow(10, CsfTable::noise_db / 20);
    const auto accepts = [](const CsfSamples& s) { return CsfTable::create(s).has_value(); };
    CsfSamples s = small_samples();
    s.sensitivity[7] = 4 * noise * 0.999; // 4 cpd at 10 degrees, where the fovea has 4
    EXPECT_TRUE(accepts(s));
    s.sensitivity[7] = 4 * noise * 1.001;
    EXPECT_FALSE(accepts(s));
    // Nothing that can be shown is seen where sensitivity is below 1.
    s = small_samples();
    s.sensitivity[2] = 1e-30, s.sensitivity[8] = 0.99 * noise;
    EXPECT_TRUE(accepts(s));
    s.sensitivity[8] = 1.01 * noise;
    EXPECT_FALSE(accepts(s));
    // By night the fovea is blind.
    s.luminance_cdm2[0] = CsfTable::rods_alone_below.value() / 2;
    EXPECT_TRUE(accepts(s));
}

TEST(CsfTable, ModelsDoNotGrowWithEccentricity) {
    for (const CsfModel model : csf_models) EXPECT_TRUE(CsfTable::create(CsfTable::from_model(model).samples()));
}

// Amounts that only a scaled table shows were never measured.
TEST(CsfTable, WhatIsMadeOfATableIsNotRefused) {
    CsfSamples s = small_samples();
    s.sensitivity = {16, 4, 1e-3, 64, 16, 4, 1.6, 0.4, 0.5, 6.4, 1.6, 0.4};
    const auto scaled = require(create(s).scaled(100));
}

TEST(CsfTable, OfWhatMovesIsAsFromTheModel) {
    RandomPlaces random(21);
    for (const CsfModel model : {CsfModel::castle, CsfModel::daly, CsfModel::barten_2004}) {
        for (const double velocity : {0.5, 10.0}) {
            const auto moving = require(CsfTable::from_model(model).moving(DegreesPerSecond(velocity)));
            const auto direct = CsfTable::from_model(model, {.velocity = DegreesPerSecond(velocity)});
            for (int i = 0; i < 500; ++i) {
                const Place p = random.next();
                if (!(interpolated(*direct, p) > 1e-3)) continue;
                EXPECT_NEAR(interpolated(*moving, p) / interpolated(*direct, p), 1, 1e-9) << name(model);
            }
        }
    }
    const CsfTable& still = CsfTable::standard();
    EXPECT_EQ(&still.moving(least_velocity)->samples(), &still.samples()) << "the eye is never at rest";
    for (const double bad : {-1.0, 81.0, not_a_number, infinity})
        EXPECT_THAT(error_in(still.moving(DegreesPerSecond(bad))), HasSubstr("0 to 80 degrees/s"));
}

// The factor is above 1 for coarse gratings: the form must hold what is coarser than the peak of stationary ones, and
// where nothing was sampled.
TEST(CsfTable, ConservativeFormHoldsWhatMoves) {
    RandomPlaces random(22);
    for (const double velocity : {0.3, 2.0, 10.0, 40.0, 80.0}) {
        const DegreesPerSecond v(velocity);
        const CsfTable moving = *CsfTable::standard().moving(v);
        double highest = 0; // of the closed form, also far below the table's first frequency
        for (double cpd = 1.0 / 1024; cpd < 64; cpd *= 1.02)
            highest = std::max(highest, sensitivity(CsfModel::castle, stimulus_of({.velocity = v}, CyclesPerDegree(cpd),
                                                                                  Degrees(0), Luminance(50))));
        EXPECT_GE(monotone(moving, {0.001, 0, 50}), highest * (1 - table_accuracy)) << velocity;
        if (velocity >= 2)
            EXPECT_GT(highest, 1.5 * CsfTable::standard().peak_sensitivity(Degrees(0), Luminance(50))) << velocity;
        for (int i = 0; i < 3000; ++i) {
            const Place p = random.next();
            const double s = sensitivity(CsfModel::castle, stimulus_of({.velocity = v}, CyclesPerDegree(p.cpd),
                                                                       Degrees(p.degrees), Luminance(p.cdm2)));
            if (s > 1) ASSERT_GT(monotone(moving, p), s * (1 - table_accuracy)) << velocity;
            Place other = p;
            other.cpd *= 2;
            ASSERT_LE(monotone(moving, other), monotone(moving, p) * (1 + rounding));
        }
    }
    // A viewer's table with few samples, none of them coarse.
    const CsfTable few = create(small_samples()), moving = *few.moving(DegreesPerSecond(10));
    for (double cpd = 1.0 / 16; cpd < 16; cpd *= 1.1) {
        const double wanted =
            interpolated(few, {cpd, 5, 10}) * velocity_factor(CyclesPerDegree(cpd), DegreesPerSecond(10));
        EXPECT_GE(monotone(moving, {cpd, 5, 10}), wanted * (1 - table_accuracy)) << cpd;
        EXPECT_NEAR(interpolated(moving, {cpd, 5, 10}) / wanted, 1, table_accuracy) << cpd;
    }
}

TEST(CsfTable, SaysHowFarItsSamplesReach) {
    const CsfTable table = create(small_samples());
    const auto beyond = [&](double degrees, double darkest, double brightest) {
        return beyond_reach(table, Degrees(degrees), Luminance(darkest), Luminance(brightest));
    };
    EXPECT_EQ(beyond(10, 1, 100), "");
    EXPECT_EQ(beyond(11, 1, 100), "beyond the table's 10 degrees sensitivity is taken as there");
    EXPECT_EQ(beyond(0, 0.5, 100), "below the table's 1 cd/m2 sensitivity is taken as there");
    EXPECT_THAT(beyond(0, 1, 101), HasSubstr("above the table's 100 cd/m2 sensitivity is taken as there, though"));
    EXPECT_THAT(beyond(11, 0.5, 101),
                testing::AllOf(HasSubstr("10 degrees"), HasSubstr("; below"), HasSubstr("; above")));
    EXPECT_THAT(beyond(not_a_number, 1, 100), HasSubstr("10 degrees"));
    // And it is taken as there.
    EXPECT_EQ(interpolated(table, {2, 60, 50}), interpolated(table, {2, 10, 50}));
    EXPECT_EQ(monotone(table, {2, 60, 50}), monotone(table, {2, 10, 50}));
    EXPECT_EQ(monotone(table, {2, 5, 1e3}), monotone(table, {2, 5, 100}));
    EXPECT_EQ(monotone(table, {2, 5, 0.1}), monotone(table, {2, 5, 1}));
}

} // namespace unseen::perception::csf_table_test
