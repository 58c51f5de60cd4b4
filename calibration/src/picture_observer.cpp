#include <unseen/calibration/internal/picture_observer.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include <unseen/perception/judge.h>
#include <unseen/vdtree/internal/random.h>

namespace unseen::calibration {
namespace {

constexpr double most_d = 1e3; // beyond, nobody errs

double detectability(const PictureObserver& observer, double visibility) {
    return std::min(PictureObserver::threshold_d * std::pow(std::max(visibility, 0.0), observer.exponent), most_d);
}

// The normal distribution function.
double below(double x) { return 0.5 * std::erfc(-x / std::numbers::sqrt2); }

} // namespace

Result<double> PictureObserver::visibility(const perception::Image& original, const perception::Image& other,
                                           const perception::Display& display) const {
    const auto judged = perception::judge_modern(original, other, perception::second_judge_options(person, display));
    if (!judged) return judged.error();
    return judged->max_ratio;
}

StudyChoice PictureObserver::choose(StudyTask task, const StudyTrial& trial, double visibility) const {
    constexpr std::uint64_t looks = 0x6c6f6f6b73u; // other numbers than those that made the order
    Random random = random_for(seed ^ looks, static_cast<std::uint64_t>(trial.number));
    const double guess = random.uniform(), d = detectability(*this, visibility);
    const double changed = d + random.normal(), unchanged = random.normal();
    if (task == StudyTask::differ) {
        const bool yes = guess < lapse ? guess < lapse / 2 : changed > criterion;
        return yes ? StudyChoice::different : StudyChoice::same;
    }
    const bool right = guess < lapse ? guess < lapse / 2 : changed > unchanged;
    return right == trial.is_other_left ? StudyChoice::left : StudyChoice::right;
}

double PictureObserver::probability(StudyTask task, double visibility) const {
    const double d = detectability(*this, visibility);
    const double attentive = task == StudyTask::which ? below(d / std::numbers::sqrt2) : below(d - criterion);
    return (1 - lapse) * attentive + lapse / 2;
}

} // namespace unseen::calibration
