// The state of a procedure: trials from beliefs, beliefs from answers.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <unseen/calibration/internal/quest.h>
#include <unseen/calibration/internal/sensitivity_field.h>
#include <unseen/calibration/procedure.h>

namespace unseen::calibration {

inline constexpr int most_plan_places = 1000, most_plan_trials = 100'000, most_plan_settings = 1000;
inline constexpr double widest_eccentricity_deg = 90;
inline constexpr double brightest_cdm2 = 1e6;
inline constexpr std::uint64_t exact_integers = std::uint64_t{1} << 53; // what JSON keeps

// The log10 sensitivity that a table predicts for a patch.
double log10_expected(const perception::CsfTable& table, const GratingPlace& place, perception::Luminance luminance);

struct Procedure::State {
    State(CalibrationPlan plan, perception::CsfTable expected, QuestPlus blank);

    void take(const Answer& answer); // combine() must follow
    void combine();
    Trial next_adjustment(Trial trial) const;

    // Beliefs about the places that decide the next trial.
    struct Prospect {
        // By place: the chance that the display can show its threshold; others need not be known well.
        std::vector<double> visible;
        // By place and slope: its log10 threshold under that slope, relative to the believed one.
        std::vector<double> shifts;
    };
    Prospect look_ahead() const;
    static double gain_of(const QuestPlus::Forecast& answer, const std::vector<double>& pulled,
                          const Prospect& prospect);

    CalibrationPlan plan;
    perception::CsfTable expected;
    std::vector<Answer> answers;
    SensitivityField field;
    std::vector<QuestPlus> quests; // by place, with the beliefs about the others as prior
    std::vector<int> asked;        // answers by place

private:
    void weigh_settings();
};

} // namespace unseen::calibration
