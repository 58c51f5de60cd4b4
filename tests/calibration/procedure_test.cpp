// The procedure with simulated observers: how near it comes to the truth, that it repeats and resumes, and what it
// refuses.
#include <unseen/calibration/internal/simulated_observer.h>
#include <unseen/calibration/procedure.h>

#include "profile_files.h"

namespace unseen::calibration::procedure_test {

using perception::CsfSamples;
using perception::CsfTable;
using perception::CyclesPerDegree;
using perception::Degrees;
using perception::Luminance;

class ProcedureTest : public ProfileFiles {};

CalibrationPlan default_plan() { return plan_for(perception::Display(), CsfTable::standard()); }

Procedure begin(const CalibrationPlan& plan) {
    auto procedure = Procedure::create(plan, CsfTable::standard());
    EXPECT_TRUE(procedure) << procedure.error().message;
    return *std::move(procedure);
}

void answer(Procedure& procedure, const SimulatedObserver& observer) {
    const Trial trial = procedure.next();
    if (procedure.plan().method == Method::adjustment) procedure.set(observer.set(trial, procedure.plan()));
    else procedure.choose(observer.choose(trial, procedure.plan().luminance));
}

SimulatedObserver observer_of(const std::string& description, std::uint64_t seed) {
    auto observer = simulated_observer(description, seed);
    EXPECT_TRUE(observer) << observer.error().message;
    return *std::move(observer);
}

// Over the places that the observer can see at all.
double rms_error_db(const Procedure& procedure, const SimulatedObserver& observer) {
    double squares = 0;
    int count = 0;
    for (const PlaceEstimate& e : procedure.estimates()) {
        const double truth = observer.sensitivity(e.place, procedure.plan().luminance);
        if (truth * procedure.plan().highest_contrast < 1) continue;
        squares += std::pow(20 * std::log10(e.sensitivity() / truth), 2);
        ++count;
    }
    return std::sqrt(squares / count);
}

TEST_F(ProcedureTest, ThePlanFitsTheDisplay) {
    const perception::Display display;
    const CalibrationPlan plan = default_plan();
    ASSERT_TRUE(validate(plan));
    EXPECT_GE(plan.places.size(), 15u);
    for (const GratingPlace& place : plan.places) {
        EXPECT_GE(34.36 / place.frequency_cpd, pixels_per_cycle - 0.01);
        EXPECT_LT(place.eccentricity_deg, perception::physical_field(display, 1600).value());
    }
    EXPECT_NEAR(plan.luminance.value(), 50.25, 1e-9);
    // At a luminance near the display's black less is seen, and less contrast can be shown.
    const CalibrationPlan dim = plan_for(display, CsfTable::standard(), Luminance(0.6));
    EXPECT_EQ(dim.luminance.value(), 0.6);
    EXPECT_NEAR(dim.highest_contrast, 0.1 / 0.6, 1e-9);
    EXPECT_LT(dim.places.size(), plan.places.size());
    // A headset's patches are drawn as a flat picture and seen through a lens: the coarser of both counts.
    perception::Display headset = display;
    headset.lens = {{0, 40}, {50, 20}};
    for (const GratingPlace& place : plan_for(headset, CsfTable::standard()).places)
        EXPECT_GE(20 / place.frequency_cpd, pixels_per_cycle - 0.01);
    perception::Display small = display;
    small.width_px = small.height_px = 200; // 5.8 degrees
    for (const GratingPlace& place : plan_for(small, CsfTable::standard()).places) {
        EXPECT_GE(place.frequency_cpd, 1);
        EXPECT_EQ(place.eccentricity_deg, 0);
    }
}

TEST_F(ProcedureTest, ThePlanHasWidePatches) {
    const perception::Display display;
    const CalibrationPlan plan = default_plan();
    std::vector<GratingPlace> wide = plan.places, small = plan.places;
    std::erase_if(wide, [](const GratingPlace& p) { return !p.is_wide(); });
    std::erase_if(small, [](const GratingPlace& p) { return p.is_wide(); });
    EXPECT_EQ(small.size(), 18u);
    EXPECT_EQ(wide, (std::vector<GratingPlace>{{0.5, 0, 100}, {0.5, 20, 100}, {1, 0, 100}, {1, 20, 100}}));
    EXPECT_EQ(plan.trials, 240);
    for (const GratingPlace& place : wide) {
        EXPECT_TRUE(fits(display, place));
        EXPECT_GT(summation_gain(place), 1.1);
        EXPECT_NEAR(std::numbers::pi * std::pow(place.sigma_deg(), 2), place.area_deg2, 1e-9);
    }
    // As large as a smaller display allows; and none where there is no room for 20 square degrees.
    perception::Display small_display = display;
    small_display.width_px = small_display.height_px = 600; // 17 degrees
    const auto smaller = wide_places(plan, small_display, CsfTable::standard());
    ASSERT_FALSE(smaller.empty());
    for (const GratingPlace& place : smaller) {
        EXPECT_GT(place.area_deg2, least_wide_deg2);
        EXPECT_LT(place.area_deg2, 60);
    }
    small_display.width_px = small_display.height_px = 200; // 5.8 degrees
    EXPECT_TRUE(wide_places(plan, small_display, CsfTable::standard()).empty());
    EXPECT_EQ(plan_for(small_display, CsfTable::standard()).trials, 200);
}

// Some near the expected castleCSF, some of other gains, scales, slopes and lapse rates; and of other shapes: Barten's
// models fall faster towards coarse gratings, Daly's declines aside by another law.
constexpr const char* other_shapes[] = {"barten-1999:gain=0.5,frequency=0.8", "barten-2004", "daly:gain=0.6",
                                        "daly:frequency=1.3,slope=3"};
constexpr const char* observers[] = {"castle",
                                     "stela:gain=0.7",
                                     "castle:gain=1.6,frequency=1.3,eccentricity=0.7",
                                     "castle:gain=0.35,frequency=0.75,eccentricity=1.5",
                                     "castle:slope=2,lapse=0.03",
                                     other_shapes[0],
                                     other_shapes[1],
                                     other_shapes[2],
                                     other_shapes[3]};

class SimulatedObservers : public testing::TestWithParam<std::uint64_t> {}; // of a seed
INSTANTIATE_TEST_SUITE_P(Seeds, SimulatedObservers, testing::Values(1, 2));

// What is owed: 1.5 dB in 400 trials, of every run. In 200 the mean over seeds is about 1 dB (docs/calibration.md), two
// runs scatter about it by a quarter, and observers of other shapes take some trials more.
TEST_P(SimulatedObservers, AreFoundWithTheirSensitivity) {
    double mean_at_200 = 0;
    for (const char* description : observers) {
        CalibrationPlan plan = default_plan();
        plan.trials = 400;
        plan.seed = GetParam();
        Procedure procedure = begin(plan);
        const SimulatedObserver observer = observer_of(description, 100 + plan.seed);
        while (!procedure.is_done()) {
            if (procedure.answers().size() == 200)
                mean_at_200 += rms_error_db(procedure, observer) / static_cast<double>(std::size(observers));
            answer(procedure, observer);
        }
        EXPECT_LT(rms_error_db(procedure, observer), 1.5) << description;
    }
    EXPECT_LT(mean_at_200, 1.1);
}

TEST_F(ProcedureTest, AdjustmentFindsItToo) {
    for (const char* description : {"castle:gain=0.7", "stela", "castle:gain=0.35,frequency=0.75,eccentricity=1.5"}) {
        CalibrationPlan plan = default_plan();
        plan.method = Method::adjustment;
        Procedure procedure = begin(plan);
        const SimulatedObserver observer = observer_of(description, 7);
        int ascending = 0;
        while (!procedure.is_done()) {
            const Trial trial = procedure.next();
            ascending += trial.is_ascending;
            const double threshold = std::pow(10, -procedure.estimates()[trial.place].log10_sensitivity.mean);
            EXPECT_EQ(trial.contrast < threshold, trial.is_ascending || threshold > plan.highest_contrast)
                << trial.number;
            answer(procedure, observer);
        }
        EXPECT_NEAR(ascending, procedure.trials() / 2, static_cast<double>(plan.places.size()));
        EXPECT_LT(rms_error_db(procedure, observer), 1.0) << description;
    }
}

TEST_F(ProcedureTest, TheFirstSettingIsPractice) {
    CalibrationPlan plan = default_plan();
    plan.method = Method::adjustment;
    Procedure careful = begin(plan), careless = begin(plan);
    const SimulatedObserver observer = observer_of("castle", 3);
    while (!careful.is_done()) {
        const double setting = observer.set(careful.next(), plan);
        careless.set(careful.answers().size() < plan.places.size() ? 0.5 : setting);
        careful.set(setting);
    }
    for (std::size_t i = 0; i < plan.places.size(); ++i)
        EXPECT_EQ(careful.estimates()[i].log10_sensitivity.mean, careless.estimates()[i].log10_sensitivity.mean);
}

TEST_F(ProcedureTest, WhatIsNotEvenSeenAtTheHighestContrastIsNoThreshold) {
    CalibrationPlan plan = default_plan();
    plan.method = Method::adjustment;
    Procedure procedure = begin(plan);
    while (!procedure.is_done()) procedure.set(plan.highest_contrast);
    for (const PlaceEstimate& e : procedure.estimates()) EXPECT_LT(e.sensitivity(), 1.2);
}

CalibrationPlan one_place(Method method, int settings = 7) {
    CalibrationPlan plan = default_plan();
    plan.method = method;
    plan.places = {{2, 0}};
    plan.settings = settings;
    return plan;
}

// Settings below the lowest contrast count as it; that they all agree makes no place infinitely certain.
TEST_F(ProcedureTest, ABeliefIsAtLeastAsWideAsTheGrid) {
    const CalibrationPlan plan = one_place(Method::adjustment, 300);
    for (const double setting :
         {7.6e-5, 1e-3, 0.031}) { // the first below the lowest contrast, the others off and on the grid
        Procedure procedure = begin(plan);
        while (!procedure.is_done()) procedure.set(setting);
        const PlaceEstimate e = procedure.estimates().front();
        constexpr double half_a_step = 0.0125; // log10 units
        const double measurable = std::max(std::log10(setting), lowest_log10_contrast);
        EXPECT_NEAR(e.log10_sensitivity.mean, -measurable, 2 * half_a_step) << setting;
        EXPECT_GT(e.log10_sensitivity.deviation, half_a_step / 2) << setting;
        EXPECT_LE(procedure.answers().back().log10_contrast, std::log10(plan.highest_contrast));
        EXPECT_GE(procedure.answers().back().log10_contrast, lowest_log10_contrast);
        const auto table = require(procedure.table("agreed"));
        EXPECT_NEAR(std::log10(table->sensitivity(CyclesPerDegree(2), Degrees(0), plan.luminance)),
                    e.log10_sensitivity.mean, half_a_step);
    }
}

// Places where nothing is seen must not pull the others towards the grid's end.
TEST_F(ProcedureTest, WhatIsFarFromVisibleIsNotPutAtTheGridsEnd) {
    for (const Method method : {Method::two_interval, Method::adjustment}) {
        CalibrationPlan plan = default_plan();
        plan.method = method;
        plan.places.clear();
        for (const double e : {0.0, 20.0, 40.0})
            for (const double f : {0.5, 2.0, 8.0, 16.0, 32.0}) plan.places.push_back({f, e});
        Procedure procedure = begin(plan);
        const SimulatedObserver observer = observer_of("castle", 1);
        while (!procedure.is_done()) answer(procedure, observer);
        for (const PlaceEstimate& e : procedure.estimates()) {
            const double truth = observer.sensitivity(e.place, plan.luminance);
            if (truth < 0.01)
                EXPECT_LT(e.sensitivity(), 0.3)
                    << e.place.frequency_cpd << " cpd " << e.place.eccentricity_deg << " deg";
        }
        EXPECT_LT(rms_error_db(procedure, observer), 1.2);
    }
}

TEST_F(ProcedureTest, WhatCannotBeMeasuredIsRefused) {
    const CalibrationPlan plan = one_place(Method::two_interval);
    EXPECT_TRUE(check_measurable(observer_of("castle:gain=20", 1), plan));
    EXPECT_THAT(error_in(check_measurable(observer_of("castle:gain=100", 1), plan)),
                AllOf(HasSubstr("2 cpd"), HasSubstr("3162")));
    CsfSamples samples = CsfTable::standard().samples();
    for (double& s : samples.sensitivity) s *= 1000;
    EXPECT_THAT(error_in(Procedure::create(plan, *CsfTable::create(samples))),
                AllOf(HasSubstr("places[0]"), HasSubstr("3162")));
    // A table that ends at the largest sensitivity there can be, elsewhere: the deviation carries it beyond.
    samples = CsfTable::standard().samples();
    for (std::size_t i = 0; i < samples.sensitivity.size(); ++i)
        if (i % samples.frequency_cpd.size() == 0) samples.sensitivity[i] = 1e6;
    auto steep = require(Procedure::create(one_place(Method::adjustment), *CsfTable::create(samples)));
    while (!steep->is_done()) steep->set(1e-3);
    EXPECT_FALSE(steep->table("beyond"));
}

TEST_F(ProcedureTest, IntervalsHoldTheTruthAboutAsOftenAsTheySay) {
    const auto share_inside = [](std::span<const char* const> descriptions, int runs) {
        int inside = 0, all = 0;
        for (const char* description : descriptions)
            for (int run = 1; run <= runs; ++run) {
                CalibrationPlan plan = default_plan();
                plan.seed = static_cast<std::uint64_t>(run);
                Procedure procedure = begin(plan);
                const SimulatedObserver observer = observer_of(description, 200 + plan.seed);
                while (!procedure.is_done()) answer(procedure, observer);
                for (const PlaceEstimate& e : procedure.estimates()) {
                    const double truth = observer.sensitivity(e.place, plan.luminance);
                    if (truth * plan.highest_contrast < 1) continue; // has no threshold
                    inside += e.low() <= truth && truth <= e.high();
                    ++all;
                }
            }
        return inside / static_cast<double>(all);
    };
    // Of 95%.
    constexpr const char* near_the_expected[] = {"stela:gain=0.8"};
    EXPECT_GT(share_inside(near_the_expected, 4), 0.9);
    EXPECT_GT(share_inside(other_shapes, 2), 0.88);
}

// Of 95%, the interval holds the truth in 9 of 10 runs; and by chance a run strays by 3 dB.
TEST_F(ProcedureTest, FindsHowAnObserverSumsOverArea) {
    int inside = 0, runs = 0;
    for (const double own : {0.6, 1.0, 2.0}) {
        double mean_db = 0;
        constexpr int seeds = 4;
        for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
            CalibrationPlan plan = default_plan();
            plan.trials = 400;
            plan.seed = seed;
            Procedure procedure = begin(plan);
            SimulatedObserver observer = observer_of("castle:gain=0.8,slope=3", 300 + seed);
            observer.summation = own;
            while (!procedure.is_done()) answer(procedure, observer);
            const Summation found = *procedure.summation();
            mean_db += 20 * std::log10(found.own / own) / seeds;
            inside += found.low <= own && own <= found.high;
            ++runs;
            EXPECT_LT(found.high / found.low, 2.3) << "7.2 dB from end to end";
            EXPECT_TRUE(check(found, plan));
            EXPECT_LT(rms_error_db(procedure, observer), 1.5);
        }
        EXPECT_NEAR(mean_db, 0, 2) << own;
    }
    EXPECT_GE(inside, runs - 2);
}

TEST_F(ProcedureTest, WithoutWidePatchesSummationIsNotKnown) {
    CalibrationPlan plan = default_plan();
    std::erase_if(plan.places, [](const GratingPlace& p) { return p.is_wide(); });
    EXPECT_FALSE(begin(plan).summation());
    EXPECT_TRUE(check(Summation(), plan));
    // Before any answer it is castle's law, with what people differ by.
    const Summation before = *begin(default_plan()).summation();
    EXPECT_EQ(before.own, 1);
    EXPECT_NEAR(std::log10(before.high), 1.96 * 0.3, 1e-3);
}

TEST_F(ProcedureTest, WidePatchesThatAreSeenWorseThanSmallOnesAreRefused) {
    const CalibrationPlan plan = default_plan();
    for (const bool is_careless : {false, true}) {
        Procedure procedure = begin(plan);
        const SimulatedObserver observer = observer_of("castle", 11);
        while (!procedure.is_done()) {
            const Trial trial = procedure.next();
            Trial seen = trial;
            // Half of what a small patch would be seen with.
            if (is_careless && trial.grating.is_wide()) seen.contrast *= 0.5 / summation_gain(trial.grating);
            procedure.choose(observer.choose(seen, plan.luminance));
        }
        const auto checked = check(*procedure.summation(), plan);
        EXPECT_EQ(checked.has_value(), !is_careless);
        if (!checked)
            EXPECT_THAT(checked.error().message, AllOf(HasSubstr("Wide patches were seen worse than small ones"),
                                                       HasSubstr("0.46"), HasSubstr("Measure again")));
    }
    // Beyond the interval: it must lie below as a whole.
    EXPECT_TRUE(check({0.3, 0.2, 0.5}, plan));
    EXPECT_FALSE(check({0.3, 0.2, 0.45}, plan));
}

// A notch of 6 dB an octave wide: the shape's parameters cannot follow it, the places' own answers must.
TEST_F(ProcedureTest, WhatDoesNotFitTheShapeComesThrough) {
    CalibrationPlan plan = default_plan();
    plan.trials = 400;
    Procedure procedure = begin(plan);
    const SimulatedObserver observer = observer_of("castle", 5);
    const auto notch = [](const GratingPlace& place) {
        return std::pow(0.5, std::exp(-std::pow(std::log2(place.frequency_cpd / 2), 2)));
    };
    while (!procedure.is_done()) {
        const Trial trial = procedure.next();
        Trial seen = trial;
        seen.contrast *= notch(trial.grating);
        procedure.choose(observer.choose(seen, plan.luminance));
    }
    double squares = 0;
    for (const PlaceEstimate& e : procedure.estimates()) {
        const double error_db =
            20 * std::log10(e.sensitivity() / (observer.sensitivity(e.place, plan.luminance) * notch(e.place)));
        squares += error_db * error_db / static_cast<double>(plan.places.size());
        EXPECT_GE(e.answers, 4);
        if (e.place == GratingPlace{2, 0}) EXPECT_LT(e.local.mean, -0.05);
    }
    EXPECT_LT(std::sqrt(squares), 1.5);
}

TEST_F(ProcedureTest, TheTableAgreesWithTheEstimates) {
    Procedure procedure = begin(default_plan());
    const SimulatedObserver observer = observer_of("castle:gain=0.5", 1);
    while (!procedure.is_done()) answer(procedure, observer);
    const auto made = require(procedure.table("me"));
    const CsfTable& table = *made;
    EXPECT_EQ(table.samples().source, "me");
    constexpr double between_samples = 0.01; // of a quarter octave, a few degrees, a quarter of a decade
    for (const PlaceEstimate& e : procedure.estimates()) {
        if (e.place.is_wide()) continue; // a table is of patches of 1.5 cycles
        const double value = table.sensitivity(CyclesPerDegree(e.place.frequency_cpd),
                                               Degrees(e.place.eccentricity_deg), procedure.plan().luminance);
        EXPECT_NEAR(value / e.sensitivity(), 1, between_samples)
            << e.place.frequency_cpd << " " << e.place.eccentricity_deg;
    }
    // Without any answers it is the expected one.
    const CsfTable blank = *begin(default_plan()).table("");
    EXPECT_NEAR(blank.sensitivity(CyclesPerDegree(4), Degrees(10), Luminance(10)) /
                    CsfTable::standard().sensitivity(CyclesPerDegree(4), Degrees(10), Luminance(10)),
                1, between_samples);
}

TEST_F(ProcedureTest, RunsRepeatAndResume) {
    for (const Method method : {Method::two_interval, Method::adjustment}) {
        CalibrationPlan plan = default_plan();
        plan.method = method;
        plan.trials = 60;
        plan.settings = 3;
        plan.seed = 42;
        const SimulatedObserver observer = observer_of("stela", 9);
        Procedure whole = begin(plan), first = begin(plan);
        while (!whole.is_done()) answer(whole, observer);
        for (int i = 0; i < 25; ++i) answer(first, observer);
        const auto file = folder() / "state.json";
        ASSERT_TRUE(first.save(file));
        auto second = require(Procedure::resume(file, CsfTable::standard()));
        EXPECT_EQ(second->answers().size(), 25u);
        while (!second->is_done()) answer(*second, observer);
        ASSERT_EQ(second->answers().size(), whole.answers().size());
        for (std::size_t i = 0; i < whole.answers().size(); ++i) {
            EXPECT_EQ(second->answers()[i].place, whole.answers()[i].place) << i;
            EXPECT_EQ(second->answers()[i].log10_contrast, whole.answers()[i].log10_contrast) << i;
            EXPECT_EQ(second->answers()[i].is_right, whole.answers()[i].is_right) << i;
        }
        EXPECT_EQ(second->estimates()[3].sensitivity(), whole.estimates()[3].sensitivity());
    }
    // Not with another table than it was begun with; files that do not say which it was take any.
    const auto file = folder() / "state.json";
    EXPECT_THAT(error_in(Procedure::resume(file, CsfTable::from_model(perception::CsfModel::stela))),
                AllOf(HasSubstr("state.json"), HasSubstr("castle"), HasSubstr("stela")));
    std::string old = read(file);
    const auto from = old.find("\"expected\""), to = old.find("\"answers\"");
    ASSERT_LT(from, to);
    old.erase(from, to - from);
    EXPECT_TRUE(Procedure::resume(write(old, "old.json"), CsfTable::from_model(perception::CsfModel::stela)));
    CalibrationPlan other = default_plan();
    other.seed = 43;
    const Trial a = begin(default_plan()).next(), b = begin(other).next();
    EXPECT_NE(a.phase_deg, b.phase_deg);
}

// States of calibrations that were begun before there were wide patches.
TEST_F(ProcedureTest, OlderStatesGoOn) {
    CalibrationPlan plan = default_plan();
    std::erase_if(plan.places, [](const GratingPlace& p) { return p.is_wide(); });
    plan.trials = 30;
    Procedure procedure = begin(plan);
    const SimulatedObserver observer = observer_of("castle", 1);
    for (int i = 0; i < 5; ++i) answer(procedure, observer);
    const auto file = folder() / "old.json";
    ASSERT_TRUE(procedure.save(file));
    EXPECT_THAT(read(file), AllOf(HasSubstr("\"version\": 1"), HasSubstr("\"places\": [[0.5, 0], [1, 0],")));
    const auto resumed = require(Procedure::resume(file, CsfTable::standard()));
    EXPECT_EQ(resumed->plan().places, plan.places);
    EXPECT_EQ(resumed->answers().size(), 5u);
}

TEST_F(ProcedureTest, RefusesPlansThatAreNone) {
    const auto error_of = [](auto change) {
        CalibrationPlan plan = default_plan();
        change(plan);
        const auto made = Procedure::create(plan, CsfTable::standard());
        return made ? "none" : made.error().message;
    };
    const double nan = std::numeric_limits<double>::quiet_NaN();
    EXPECT_THAT(error_of([](CalibrationPlan& p) { p.places.clear(); }), HasSubstr("places"));
    EXPECT_THAT(error_of([](CalibrationPlan& p) { p.places[1] = p.places[0]; }), HasSubstr("places[1] is there twice"));
    EXPECT_THAT(error_of([=](CalibrationPlan& p) { p.places[2].frequency_cpd = nan; }),
                HasSubstr("places[2]: the frequency"));
    EXPECT_THAT(error_of([](CalibrationPlan& p) { p.places[2].eccentricity_deg = -1; }),
                HasSubstr("places[2]: the eccentricity"));
    EXPECT_THAT(error_of([](CalibrationPlan& p) { p.places[2].frequency_cpd = 65; }),
                HasSubstr("places[2]: the frequency"));
    EXPECT_THAT(error_of([](CalibrationPlan& p) { p.places[2].eccentricity_deg = 91; }),
                HasSubstr("places[2]: the eccentricity"));
    EXPECT_THAT(error_of([](CalibrationPlan& p) { p.seed = (std::uint64_t{1} << 53) + 1; }), HasSubstr("seed"));
    EXPECT_THAT(error_of([](CalibrationPlan& p) { p.luminance = Luminance(2e6); }), HasSubstr("luminance"));
    EXPECT_THAT(error_of([](CalibrationPlan& p) { p.trials = 0; }), HasSubstr("trials"));
    EXPECT_THAT(error_of([](CalibrationPlan& p) { p.settings = 1; }), HasSubstr("settings"));
    EXPECT_THAT(error_of([=](CalibrationPlan& p) { p.luminance = Luminance(nan); }), HasSubstr("luminance"));
    EXPECT_THAT(error_of([](CalibrationPlan& p) { p.highest_contrast = 1.5; }), HasSubstr("contrast"));
    EXPECT_THAT(error_of([](CalibrationPlan& p) { p.highest_contrast = 1e-6; }), HasSubstr("contrast"));
}

TEST_F(ProcedureTest, BadStatesNameTheFileAndThePlace) {
    CalibrationPlan plan = default_plan();
    plan.trials = 5;
    Procedure procedure = begin(plan);
    for (int i = 0; i < 3; ++i) procedure.choose(1);
    const auto file = folder() / "state.json";
    ASSERT_TRUE(procedure.save(file));
    const std::string good = read(file);
    struct BadCase {
        const char *from, *to, *expected;
    };
    const BadCase cases[] = {{"unseen-calibration", "unseen-csf", "\"format\""},
                             {"\"version\": 2", "\"version\": 3", "version"},
                             {"\"2ifc\"", "\"3ifc\"", "\"method\" must be"},
                             {"\"seed\": 1", "\"seed\": -1", "seed"},
                             {"\"trials\": 5", "\"trials\": 2", "\"answers\" has more"},
                             {"\"places\": [[", "\"places\": [[1], [", "places[0]"},
                             {"\"places\": [[0.5", "\"places\": [[0", "places[0]: the frequency"},
                             {"\"places\": [[0.5, 0, 0]", "\"places\": [[0.5, 0, -1]", "places[0]: the area"},
                             {"\"answers\": [\n[", "\"answers\": [\n[99", "\"answers[0]\" has no place"},
                             {"\"luminance_cdm2\": ", "\"luminance_cdm2\": -", "luminance_cdm2"}};
    for (const BadCase& bad : cases)
        EXPECT_THAT(
            error_in(Procedure::resume(write(replaced(good, bad.from, bad.to), "bad.json"), CsfTable::standard())),
            AllOf(HasSubstr("bad.json"), HasSubstr(bad.expected)))
            << bad.expected;
    for_each_mutation(good, 150, [&](const std::string& text) {
        const auto resumed = Procedure::resume(write(text), CsfTable::standard());
        if (!resumed) EXPECT_THAT(resumed.error().message, HasSubstr("profile.json"));
    });
}

TEST_F(ProcedureTest, ObserversAreDescribedByNameAndKeys) {
    const SimulatedObserver plain = observer_of("castle", 1), dim = observer_of("castle:gain=0.7,frequency=0.5", 1);
    EXPECT_NEAR(dim.sensitivity({2, 0}, Luminance(50)), 0.7 * plain.sensitivity({4, 0}, Luminance(50)), 1e-9);
    for (const auto& [text, expected] : {std::pair{"nobody", "neither"},
                                         {"castle:gain", "none of"},
                                         {"castle-red-green", "colour"},
                                         {"castle:gain=0", "gain"},
                                         {"castle:gain=nan", "gain"},
                                         {"castle:gain=1x", "gain"},
                                         {"castle:lapse=0.9", "lapse"},
                                         {"castle:age=40", "'age=40' is none of"},
                                         {"missing.json", "missing.json"}}) {
        EXPECT_THAT(error_in(simulated_observer(text, 1)), HasSubstr(expected)) << text;
    }
}

} // namespace unseen::calibration::procedure_test
