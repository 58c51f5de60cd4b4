// Measuring an observer: which grating to show next, and what the answers say. Knows neither windows nor keys.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <unseen/calibration/quest.h>
#include <unseen/calibration/sensitivity_field.h>
#include <unseen/perception/csf.h>
#include <unseen/perception/display.h>
#include <unseen/vdtree/result.h>

namespace unseen::calibration {

enum class Method {
    two_interval, // a grating in one of two intervals: in which? Contrasts by QUEST+
    adjustment,   // the observer sets the contrast to where the grating just appears (the 2001 paper) or disappears
};
std::string_view name(Method method); // "2ifc", "adjustment"

struct CalibrationPlan {
    Method method = Method::two_interval;
    std::vector<GratingPlace> places;    // what is measured
    int trials = 200;                    // of two_interval; plan_for() adds trials_of_wide_place for each wide patch
    int settings = 7;                    // of adjustment, at each place; the first is practice and does not count
    perception::Luminance luminance{50}; // mean luminance of the gratings, at most 1e6 cd/m2
    double highest_contrast = 1;         // Michelson, that the display can show
    std::uint64_t seed = 1;              // at most 2^53, which JSON keeps
};

// The lowest contrast that is shown, 10^-3.5: nobody sees a fainter grating. Thresholds below it cannot be measured.
inline constexpr double lowest_log10_contrast = -3.5;

// A plan whose gratings fit a display: octaves from 0.5 cpd to 16, as far as a cycle has `pixels_per_cycle`;
// eccentricities of 0, 5, 10 and 20 degrees, as far as they fit beside a fixation cross at the screen's edge; of these,
// what the expected observer sees at a third of the highest contrast. The luminance is midway between the display's
// black and white where none is given; one that is must lie between them, and the highest contrast is what the display
// has room for on either side of it.
// Then its wide_places(), and the trials for them.
inline constexpr double pixels_per_cycle = 4;
inline constexpr int trials_of_wide_place = 10; // about what each of the others has
CalibrationPlan plan_for(const perception::Display& display, const perception::CsfTable& expected,
                         std::optional<perception::Luminance> luminance = {});

// Wide patches for a plan: of its two lowest frequencies, at its least eccentricity and at the largest at which there is
// room beside the cross; as large as the display allows, up to most_wide_deg2. None smaller than least_wide_deg2, none
// that castle's law of area takes for hardly better than a patch of 1.5 cycles, and none that the expected observer
// would not see.
inline constexpr double least_wide_deg2 = 20;
inline constexpr double most_wide_deg2 = 100; // castleCSF's law was held against patches of up to so much
std::vector<GratingPlace> wide_places(const CalibrationPlan& plan, const perception::Display& display,
                                      const perception::CsfTable& expected);

// Whether a patch and the cross beside it fit on the display.
bool fits(const perception::Display& display, const GratingPlace& place);

// 1 to 1000 places with frequencies of 1/16 to 64 cpd, eccentricities of 0 to 90 degrees and areas of up to 10,000
// square degrees (0: of 1.5 cycles radius), none twice, and not all of them wide; 1 to 100,000
// trials; 2 to 1000 settings; luminance above 0 and at most 1e6 cd/m2; 0 < highest_contrast <= 1; a seed of at most
// 2^53. The error names the field.
Result<void> validate(const CalibrationPlan& plan);

// One thing to show. Two-interval: the grating is in `interval` 1 or 2. Adjustment: it begins at `contrast`, unseen if
// ascending.
struct Trial {
    int number = 0; // from 0
    std::size_t place = 0;
    GratingPlace grating;
    double contrast = 0; // Michelson
    int interval = 1;
    bool is_ascending = false;
    double phase_deg = 0;
};

struct Answer {
    std::size_t place = 0;
    double log10_contrast = 0; // shown, or set
    bool is_right = false;     // two-interval; adjustment: seen at all
};

// What a place comes to.
struct PlaceEstimate {
    GratingPlace place;
    int answers = 0;
    SensitivityField::Belief log10_sensitivity;
    SensitivityField::Belief local; // how far it strays from the fitted shape, log10 units
    double low() const;             // 95% interval of the sensitivity
    double high() const;
    double sensitivity() const;
};

// How an observer sums over area: `own` of perception::summation_gain(). The interval is that of 95% confidence.
struct Summation {
    double own = 1, low = 1, high = 1; // castle's law of area, taken and not measured
    bool operator==(const Summation&) const = default;
};

// Fails where wide patches of the plan were seen worse than small ones of the same bars and place, beyond the interval:
// no eye does so.
Result<void> check(const Summation& measured, const CalibrationPlan& plan);

class Procedure {
public:
    // `expected` is what an observer is believed to see before any answer. Fails on plans that validate() refuses,
    // where no contrast is left to show, and where the expected threshold of a place is below the lowest contrast.
    static Result<Procedure> create(CalibrationPlan plan, perception::CsfTable expected);

    const CalibrationPlan& plan() const noexcept { return plan_; }
    const std::vector<Answer>& answers() const noexcept { return answers_; }
    int trials() const noexcept; // in all
    bool is_done() const noexcept { return static_cast<int>(answers_.size()) >= trials(); }

    // The same until it is answered, and the same for the same plan and answers. Precondition: !is_done().
    // Two-interval: the place and the contrast whose answer is expected to leave the least variance of the thresholds
    // of all places that can be seen at all; every fourth time at the place that was asked least, of those that may be
    // visible. Cost: about 1 ms for 18 places.
    Trial next() const;
    // Answers next(). Preconditions: !is_done(), and the plan's method.
    void choose(int interval);
    void set(double contrast); // above 0, below the lowest contrast: as that; the highest or more: not seen even there

    std::vector<PlaceEstimate> estimates() const;
    std::optional<Summation> summation() const; // none without wide patches
    // The expected table with the measured deviations, on the axes of a profile (see calibrated_table in the sources):
    // beyond the measured places, and at other luminances, the deviation of the nearest measured frequency and
    // eccentricity is taken. Fails where that is no table (CsfTable::create()): where the expected one comes near to
    // the largest sensitivity that there can be.
    Result<perception::CsfTable> table(std::string source) const;

    // The plan and all answers, to go on later. Reading checks everything, the plan and each answer, and fails on a bad
    // file with its name and the place; and where `expected` is another table than the calibration was begun with (a
    // hash of its numbers is kept, as floats; files from before that was so have none, and take any).
    Result<void> save(const std::filesystem::path& file) const;
    static Result<Procedure> resume(const std::filesystem::path& file, perception::CsfTable expected);

private:
    Procedure(CalibrationPlan plan, perception::CsfTable expected, QuestPlus blank);
    void take(const Answer& answer);
    void combine();
    void weigh_settings();
    // What is believed of the places, as far as the next trial goes by it.
    struct Prospect {
        // By place: the chance that the display can show its threshold; others need not be known well.
        std::vector<double> visible;
        // By place and slope: where its log10 threshold would be with that, relative to where it is believed.
        std::vector<double> shifts;
    };
    Prospect look_ahead() const;
    static double gain_of(const QuestPlus::Forecast& answer, const std::vector<double>& pulled,
                          const Prospect& prospect);
    Trial next_adjustment(Trial trial) const;

    CalibrationPlan plan_;
    perception::CsfTable expected_;
    std::vector<Answer> answers_;
    SensitivityField field_;
    std::vector<QuestPlus> quests_; // by place: with the belief of the others as prior
    std::vector<int> asked_;        // answers by place
};

} // namespace unseen::calibration
