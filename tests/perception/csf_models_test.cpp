// The classical models and castleCSF's chromatic branches: golden values, what eccentricity and motion add to models
// that know neither, and the places where formulas lose their digits or their finiteness.
#include <unseen/perception/csf.h>
#include <unseen/perception/internal/motion.h>

#include "cone_contrast.h"
#include "testing.h"

namespace unseen::perception::csf_models_test {

// Relative. Of formulas in double against each other.
constexpr double classical_tolerance = 1e-9;
// Half a unit in the ninth digit, which the golden values are printed with, of a number that starts with 1.
constexpr double printing = 5e-9;
// Relative, of the published program's numbers: its constants are given with six digits.
constexpr double castle_tolerance = 1e-6;
constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();

constexpr std::array by_geisler_perry = {CsfModel::barten_1989, CsfModel::barten_1999, CsfModel::barten_2004,
                                         CsfModel::mannos_sakrison, CsfModel::rushmeier};

std::vector<std::vector<double>> numbers_in(const std::string& file_name) {
    std::ifstream file(file_name);
    std::vector<std::vector<double>> rows;
    for (std::string line; std::getline(file, line);) {
        if (line.empty() || !std::isdigit(static_cast<unsigned char>(line[0]))) continue;
        std::istringstream cells(line);
        std::vector<double>& row = rows.emplace_back();
        for (std::string cell; std::getline(cells, cell, ',');) row.push_back(std::stod(cell));
    }
    return rows;
}

Stimulus foveal(double cpd, double cdm2, double area_deg2 = 1) {
    return {.frequency = CyclesPerDegree(cpd), .luminance = Luminance(cdm2), .area = SquareDegrees(area_deg2)};
}
Stimulus at(Stimulus s, double degrees) {
    s.eccentricity = Degrees(degrees);
    return s;
}
Stimulus moving(Stimulus s, double degrees_per_second) {
    s.velocity = DegreesPerSecond(degrees_per_second);
    return s;
}
Stimulus flickering(Stimulus s, double hertz) {
    s.temporal = Hertz(hertz);
    return s;
}

TEST(CsfModels, ClassicalOnesAgreeWithTheReferenceToItsLastDigit) {
    // The greatest values of the published relative curves, which are scaled here.
    constexpr double mannos_sakrison_peak = 0.98087787655726166, rushmeier_peak = 1.8830747958791485;
    const auto rows = numbers_in("tests/data/csf_classical_golden.csv");
    ASSERT_EQ(rows.size(), 131u);
    for (const auto& row : rows) {
        const Stimulus s = foveal(row[0], row[1], row[2]);
        const auto expect = [&](CsfModel model, double value, double golden) {
            EXPECT_NEAR(value / golden, 1, classical_tolerance + printing)
                << name(model) << " at " << row[0] << " cpd, " << row[1] << " cd/m2, " << row[2] << " deg2, " << row[3];
        };
        const double scale = 1 / relative_models_peak;
        expect(CsfModel::mannos_sakrison, sensitivity(CsfModel::mannos_sakrison, s) * scale * mannos_sakrison_peak,
               row[4]);
        expect(CsfModel::rushmeier, sensitivity(CsfModel::rushmeier, s) * scale * rushmeier_peak, row[5]);
        expect(CsfModel::daly, sensitivity(CsfModel::daly, at(s, row[3])), row[6]);
        expect(CsfModel::barten_1989, sensitivity(CsfModel::barten_1989, s), row[7]);
        expect(CsfModel::barten_2004, sensitivity(CsfModel::barten_2004, s), row[8]);
        expect(CsfModel::barten_1999, sensitivity(CsfModel::barten_1999, s), row[9]);
    }
}

TEST(CsfModels, ChromaticBranchesAgreeWithThePublishedProgram) {
    const auto rows = numbers_in("tests/data/csf_chromatic_golden.csv");
    ASSERT_EQ(rows.size(), 98u);
    for (const auto& row : rows) {
        Stimulus s = flickering(at(foveal(row[0], row[2], row[4]), row[1]), row[3]);
        s.field = row[5] == 0 ? VisualField::temporal : VisualField::nasal;
        EXPECT_NEAR(sensitivity(CsfModel::castle_red_green, s) / row[6], 1, castle_tolerance);
        EXPECT_NEAR(sensitivity(CsfModel::castle_yellow_violet, s) / row[7], 1, castle_tolerance);

        // The whole model, as sensitivity to cone contrast: sqrt(3) / |contrast of the cones| at threshold.
        const glm::dvec3 background = glm::dvec3(0.6991, 0.3009, 0.0198) * row[2], delta(0.6855, 0.2951, 0.0194);
        const double steps = 1 / support::castle_visibility(support::opponent_contrast(background, delta), s);
        const glm::dvec3 cones = steps * delta / background;
        EXPECT_NEAR(std::sqrt(3.0) / std::hypot(cones.x, cones.y, cones.z) / row[8], 1, castle_tolerance);
    }
}

TEST(CsfModels, CastlesPeaksAreWhereTheyShouldBe) {
    // From a search over frequencies half a percent apart, by another program.
    constexpr double search_step = 1e-4;
    struct Row {
        double cdm2, degrees, area_deg2, hertz, peak_cpd, peak;
    };
    const Row rows[] = {
        {0.1, 0, 1, 0, 0.95926, 16.45047},  {1, 0, 1, 8, 1.1173, 30.99676},      {1, 20, 10, 8, 0.23651, 13.29724},
        {10, 0, 10, 0, 2.0849, 210.6925},   {100, 0, 1, 0, 3.9449, 134.2961},    {100, 20, 10, 0, 1.1975, 21.62938},
        {1000, 20, 1, 0, 2.0849, 8.105955}, {1000, 20, 10, 8, 0.18686, 50.6008},
    };
    for (const Row& row : rows) {
        const auto at_frequency = [&](double cpd) {
            return sensitivity(CsfModel::castle,
                               flickering(at(foveal(cpd, row.cdm2, row.area_deg2), row.degrees), row.hertz));
        };
        EXPECT_NEAR(at_frequency(row.peak_cpd) / row.peak, 1, castle_tolerance) << row.cdm2 << " cd/m2";
        double peak = 0;
        for (double cpd = 0.05; cpd < 64; cpd *= 1.0005) peak = std::max(peak, at_frequency(cpd));
        EXPECT_NEAR(peak / row.peak, 1, search_step) << row.cdm2 << " cd/m2, " << row.degrees << " degrees";
    }
}

TEST(CsfModels, RelativeOnesPeakAtTheStatedSensitivity) {
    for (const CsfModel model : {CsfModel::mannos_sakrison, CsfModel::rushmeier}) {
        double peak = 0, peak_cpd = 0;
        for (double cpd = 1; cpd < 20; cpd *= 1.0001) {
            const double s = sensitivity(model, foveal(cpd, 100));
            if (s > peak) peak = s, peak_cpd = cpd;
            EXPECT_EQ(s, sensitivity(model, foveal(cpd, 0.1, 33))) << "neither luminance nor area matter";
        }
        EXPECT_NEAR(peak / relative_models_peak, 1, 1e-7) << name(model);
        EXPECT_NEAR(peak_cpd, model == CsfModel::rushmeier ? 3.6046 : 7.8909, 0.001);
    }
}

TEST(CsfModels, DalysDistanceSharpens) {
    Stimulus far = foveal(20, 100), near = far;
    near.distance = Metres(0.3), far.distance = Metres(3);
    EXPECT_GT(sensitivity(CsfModel::daly, far), sensitivity(CsfModel::daly, near));
    for (const CsfModel model : csf_models) {
        if (model == CsfModel::daly) continue;
        EXPECT_EQ(sensitivity(model, far), sensitivity(model, near)) << name(model);
    }
}

TEST(CsfModels, FallWithEccentricityInAnyField) {
    for (const CsfModel model : csf_models) {
        for (const VisualField field : {VisualField::nasal, VisualField::temporal, VisualField::worst}) {
            for (const double cpd : {4.0, 16.0}) {
                double before = infinity;
                for (double degrees = 0; degrees <= 30; degrees += 3) {
                    Stimulus s = at(foveal(cpd, 50), degrees);
                    s.field = field;
                    const double here = sensitivity(model, s);
                    EXPECT_LT(here, before) << name(model) << " at " << degrees;
                    before = here;
                }
            }
        }
    }
}

TEST(CsfModels, ModelsWithoutAPeripheryTakeGeislerAndPerrys) {
    // Threshold contrast grows as exp(0.106 rho (e + 2.3) / 2.3), so relative to the fovea as exp(0.106 rho e / 2.3).
    for (const CsfModel model : by_geisler_perry) {
        for (const double degrees : {1.0, 10.0, 50.0}) {
            const double ratio = sensitivity(model, at(foveal(2, 50), degrees)) / sensitivity(model, foveal(2, 50));
            EXPECT_NEAR(ratio / std::exp(-0.106 * 2 * degrees / 2.3), 1, 1e-12);
            Stimulus nasal = at(foveal(2, 50), degrees), temporal = nasal;
            nasal.field = VisualField::nasal, temporal.field = VisualField::temporal;
            EXPECT_EQ(sensitivity(model, nasal), sensitivity(model, temporal));
        }
    }
}

TEST(CsfModels, VelocityMultipliesStaticSensitivity) {
    for (const CsfModel model : csf_models) {
        for (const double cpd : {0.2, 2.0, 20.0}) {
            const double still = sensitivity(model, foveal(cpd, 50));
            EXPECT_EQ(sensitivity(model, moving(foveal(cpd, 50), 0.1)), still) << "the eye is never at rest";
            for (const double speed : {0.5, 5.0, 50.0}) {
                const double factor = velocity_factor(CyclesPerDegree(cpd), DegreesPerSecond(speed));
                EXPECT_NEAR(sensitivity(model, moving(foveal(cpd, 50), speed)) / (still * factor), 1, 1e-12);
            }
        }
        EXPECT_LT(sensitivity(model, moving(foveal(8, 50), 10)), 0.1 * sensitivity(model, foveal(8, 50)));
        EXPECT_GT(sensitivity(model, moving(foveal(0.2, 50), 10)), sensitivity(model, foveal(0.2, 50)));
    }
}

TEST(CsfModels, FlickerIsADriftForModelsThatKnowNone) {
    for (const CsfModel model : {CsfModel::daly, CsfModel::barten_1989, CsfModel::barten_1999, CsfModel::barten_2004,
                                 CsfModel::mannos_sakrison, CsfModel::rushmeier}) {
        EXPECT_EQ(sensitivity(model, flickering(foveal(4, 50), 8)), sensitivity(model, moving(foveal(4, 50), 2)));
    }
    for (const CsfModel model : {CsfModel::castle, CsfModel::stela, CsfModel::castle_red_green})
        EXPECT_NE(sensitivity(model, flickering(foveal(4, 50), 8)), sensitivity(model, moving(foveal(4, 50), 2)));
}

TEST(CsfModels, OutsideOfTheDomainIsNotANumber) {
    for (const CsfModel model : csf_models) {
        for (const double bad : {0.0, -1.0, infinity, not_a_number}) {
            EXPECT_TRUE(std::isnan(sensitivity(model, foveal(bad, 50)))) << name(model) << " " << bad;
            EXPECT_TRUE(std::isnan(sensitivity(model, foveal(4, bad)))) << name(model) << " " << bad;
            EXPECT_TRUE(std::isnan(sensitivity(model, foveal(4, 50, bad)))) << name(model) << " " << bad;
            Stimulus s = foveal(4, 50);
            s.distance = Metres(bad);
            EXPECT_TRUE(std::isnan(sensitivity(model, s))) << name(model) << " " << bad;
        }
        for (const double bad : {-1.0, infinity, not_a_number}) {
            EXPECT_TRUE(std::isnan(sensitivity(model, at(foveal(4, 50), bad)))) << name(model) << " " << bad;
            EXPECT_TRUE(std::isnan(sensitivity(model, moving(foveal(4, 50), bad)))) << name(model) << " " << bad;
            EXPECT_TRUE(std::isnan(sensitivity(model, flickering(foveal(4, 50), bad)))) << name(model) << " " << bad;
        }
        EXPECT_TRUE(std::isnan(sensitivity(model, flickering(moving(foveal(4, 50), 1), 8)))) << "both at once";
    }
}

TEST(CsfModels, AreFiniteOverTheWholeDomain) {
    for (const CsfModel model : csf_models) {
        for (const double cpd : {1e-150, 1e-6, 0.0625, 1.0, 64.0, 1e3, 1e6}) {
            for (const double cdm2 : {1e-9, 1e-5, 1e-3, 0.0113, 1.0, 1e4, 1e9}) {
                for (const double area : {1e-300, 1e-6, 1.0, 1e6, 1e300}) {
                    for (const double degrees : {0.0, 120.0}) {
                        const Stimulus s = at(foveal(cpd, cdm2, area), degrees);
                        for (const Stimulus& t : {s, moving(s, 1e-3), moving(s, 300), flickering(s, 200)}) {
                            const double value = sensitivity(model, t);
                            ASSERT_TRUE(std::isfinite(value) && value >= 0)
                                << name(model) << ": " << cpd << " cpd, " << cdm2 << " cd/m2, " << area << " deg2, "
                                << degrees << " deg, " << t.velocity.value() << " deg/s: " << value;
                        }
                    }
                }
            }
        }
    }
}

TEST(CsfModels, DalysAreaNeitherUnderNorOverflows) {
    // ((3.23 (rho^2 A)^-0.3)^5 + 1)^-0.2 tends to (rho^2 A)^0.3 / 3.23 for small patches and to 1 for large ones.
    const double tiny = sensitivity(CsfModel::daly, foveal(1, 100, 1e-280));
    EXPECT_NEAR(sensitivity(CsfModel::daly, foveal(1, 100, 1e-290)) / tiny, 1e-3, 1e-12);
    EXPECT_GT(tiny, 0);
    const double large = sensitivity(CsfModel::daly, foveal(1, 100, 1e200));
    EXPECT_NEAR(sensitivity(CsfModel::daly, foveal(1, 100, 1e300)) / large, 1, 1e-12);
}

TEST(CsfModels, CoarseGratingsVanishButTheConservativeTableDoesNot) {
    for (const CsfModel model : csf_models) {
        if (!is_achromatic(model) || model == CsfModel::mannos_sakrison) continue; // these are low-pass
        EXPECT_LT(sensitivity(model, foveal(1e-4, 50)), 1) << name(model);
        const CsfTable table = CsfTable::from_model(model);
        const double peak = table.peak_sensitivity(Degrees(0), Luminance(50));
        EXPECT_GT(peak, 10);
        EXPECT_EQ(table.monotone_sensitivity(CyclesPerDegree(1e-4), Degrees(0), Luminance(50)), peak) << name(model);
    }
}

TEST(CsfModels, HaveDistinctNames) {
    for (const CsfModel model : csf_models) {
        EXPECT_EQ(*require(csf_model(name(model))), model);
    }
    const auto unknown = csf_model("barten");
    ASSERT_FALSE(unknown);
    for (const CsfModel model : csf_models)
        EXPECT_THAT(unknown.error().message, testing::HasSubstr(std::string(name(model))));
}

} // namespace unseen::perception::csf_models_test
