#include <unseen/calibration/internal/picture_observer.h>

#include <algorithm>
#include <cmath>

#include <unseen/perception/judge.h>
#include <unseen/vdtree/internal/random.h>

namespace unseen::calibration {
namespace {

constexpr double most_d = 1e3; // beyond, nobody errs

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
    const double guess = random.uniform(),
                 d = std::min(threshold_d * std::pow(std::max(visibility, 0.0), exponent), most_d);
    const double changed = d + random.normal(), unchanged = random.normal();
    if (task == StudyTask::differ) {
        const bool yes = guess < lapse ? guess < lapse / 2 : changed > criterion;
        return yes ? StudyChoice::different : StudyChoice::same;
    }
    const bool right = guess < lapse ? guess < lapse / 2 : changed > unchanged;
    return right == trial.is_other_left ? StudyChoice::left : StudyChoice::right;
}

} // namespace unseen::calibration
