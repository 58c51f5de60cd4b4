// Measuring an observer: chooses the gratings to show, and turns the answers into sensitivities. The caller draws and asks.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <unseen/perception/csf.h>
#include <unseen/perception/display.h>
#include <unseen/vdtree/result.h>

namespace unseen::calibration {

// A static grating patch at an eccentricity.
struct GratingPlace {
    double frequency_cpd = 0, eccentricity_deg = 0;
    double area_deg2 = 0; // pi sigma^2; 0: a radius of 1.5 cycles, as in CsfTable
    bool is_wide() const { return area_deg2 > 0; }
    double sigma_deg() const; // of the patch's envelope
    bool operator==(const GratingPlace&) const = default;
};
// How many times better it is seen than a patch of 1.5 cycles there. `own`: how the observer sums over area
// (perception/csf.h).
double summation_gain(const GratingPlace& place, double own = 1);

inline constexpr double normal_95 = 1.959964; // deviations of a normal distribution that 95% lie within

// A normal distribution.
struct Belief {
    double mean = 0, deviation = 0;
};

enum class Method {
    two_interval, // the observer says which of two intervals has a grating; contrasts by QUEST+
    adjustment,   // the observer sets the contrast at which the grating just appears (the 2001 paper) or disappears
};
std::string_view name(Method method); // "2ifc", "adjustment"

struct CalibrationPlan {
    Method method = Method::two_interval;
    std::vector<GratingPlace> places;    // to measure
    int trials = 200;                    // two_interval; plan_for() adds trials_of_wide_place for each wide patch
    int settings = 7;                    // adjustment, at each place; the first is practice and does not count
    perception::Luminance luminance{50}; // mean luminance of the gratings, at most 1e6 cd/m2
    double highest_contrast = 1;         // Michelson contrast that the display can show
    std::uint64_t seed = 1;              // at most 2^53, the exact integers of JSON
};

// The lowest contrast shown is 10^-3.5: nobody sees a fainter grating. Lower thresholds cannot be measured.
inline constexpr double lowest_log10_contrast = -3.5;

// A plan whose gratings fit a display: octaves from 0.5 to 16 cpd with at least `pixels_per_cycle`, at eccentricities of 0,
// 5, 10 and 20 degrees that fit beside a fixation cross at the screen's edge, if the expected observer sees them at a
// third of the highest contrast. Then its wide_places(), and the trials for them. `luminance` must lie between the
// display's black and white, and limits the highest contrast; default: midway.
inline constexpr double pixels_per_cycle = 4;
inline constexpr int trials_of_wide_place = 10; // about as many as the other places have
CalibrationPlan plan_for(const perception::Display& display, const perception::CsfTable& expected,
                         std::optional<perception::Luminance> luminance = {});

// Wide patches for a plan: its two lowest frequencies, at its least eccentricity and at the largest one with room beside
// the cross, as large as the display allows, from least_wide_deg2 to most_wide_deg2. Patches are left out if the expected
// observer would not see them, or if castleCSF's law of area makes them hardly more visible than a patch of 1.5 cycles.
inline constexpr double least_wide_deg2 = 20;
inline constexpr double most_wide_deg2 = 100; // castleCSF's law was tested with patches up to this size
std::vector<GratingPlace> wide_places(const CalibrationPlan& plan, const perception::Display& display,
                                      const perception::CsfTable& expected);

// Whether a patch and the cross beside it fit on the display.
bool fits(const perception::Display& display, const GratingPlace& place);

// Ranges: 1 to 1000 different places, not all wide, with frequencies of 1/16 to 64 cpd, eccentricities of 0 to 90 degrees
// and areas up to 10,000 square degrees; 1 to 100,000 trials; 2 to 1000 settings; luminance above 0, at most 1e6 cd/m2;
// 0 < highest_contrast <= 1; seed at most 2^53. The error names the field.
Result<void> validate(const CalibrationPlan& plan);

// One grating to show. Two-interval: in `interval` 1 or 2. Adjustment: starting at `contrast`, invisible if ascending.
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
    bool is_right = false;     // adjustment: seen at all
};

// The measured sensitivity at a place.
struct PlaceEstimate {
    GratingPlace place;
    int answers = 0;
    Belief log10_sensitivity;
    Belief local; // its deviation from the fitted shape, log10 units
    double sensitivity() const { return at(0); }
    double low() const { return at(-normal_95); } // 95% interval of the sensitivity
    double high() const { return at(normal_95); }
    double at(double deviations) const;
};

// How an observer sums over area: `own` of perception::summation_gain(), with its 95% interval.
struct Summation {
    double own = 1, low = 1, high = 1; // default: castle's law of area, not measured
    bool operator==(const Summation&) const = default;
};

// Fails if wide patches were seen worse than small ones of the same bars and place, beyond the interval: no eye does so.
Result<void> check(const Summation& measured, const CalibrationPlan& plan);

class Procedure {
public:
    // `expected`: the sensitivities assumed before any answer. Fails on invalid plans, if no contrast is left to show, and if
    // the expected threshold at a place is below the lowest contrast.
    static Result<Procedure> create(CalibrationPlan plan, perception::CsfTable expected);

    Procedure(Procedure&&) noexcept;
    Procedure& operator=(Procedure&&) noexcept;
    ~Procedure();

    const CalibrationPlan& plan() const noexcept;
    const std::vector<Answer>& answers() const noexcept;
    int trials() const noexcept; // in total
    bool is_done() const noexcept { return static_cast<int>(answers().size()) >= trials(); }

    // The next trial, which depends on the plan and the answers alone. Precondition: !is_done(). Two-interval: the place and
    // the contrast whose answer is expected to leave the least variance of all visible thresholds; every fourth time at the
    // least-asked place that may be visible. Cost: about 1 ms for 18 places.
    Trial next() const;
    // Answers next(). Preconditions: !is_done(), and the plan's method.
    void choose(int interval);
    void set(double contrast); // above 0; the plan's highest contrast or more: not seen even there

    std::vector<PlaceEstimate> estimates() const;
    std::optional<Summation> summation() const; // nullopt without wide patches
    // The expected table with the measured deviations. Beyond the measured places, and at other luminances, it has the
    // deviation of the nearest measured frequency and eccentricity. Fails if that is no valid table (CsfTable::create()).
    Result<perception::CsfTable> table(std::string source) const;

    // Saves the plan and all answers, to continue later. resume() checks all of them; errors name the file and the place. It
    // fails if `expected` is not the table that the calibration began with (the file keeps a hash of its numbers).
    Result<void> save(const std::filesystem::path& file) const;
    static Result<Procedure> resume(const std::filesystem::path& file, perception::CsfTable expected);

private:
    struct State;
    explicit Procedure(std::unique_ptr<State> state);
    std::unique_ptr<State> state_;
};

} // namespace unseen::calibration
