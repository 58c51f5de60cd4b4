// A judge of image pairs that knows how large what differs is: the larger, the better it is seen.
#pragma once

#include <memory>

#include <perception/judge.h>
#include <perception/person.h>

namespace unseen::perception {

// As judge_modern(), but for space: energy, the square of contrasts in thresholds, is summed in each band over a window
// whose form is castleCSF's law of area. So a patch of area A is seen sqrt(A / (A + Ac)) times as well as an unlimited
// one, and many small differences beside each other better than one. judge_modern() knows patches of 1.5 cycles only.
//
// A Gabor patch of 1.5 cycles radius reaches V = 1 within 3 dB of contrast 1 / S, between 0.5 cpd and the display's
// limit. Gratings at the thresholds of people (<calibration/people.h>), of any area, reach 1.0 in the median, for the
// median person.
class SummingJudge {
public:
    // Prepares the reference, in cd/m2: some 0.3 us and 20 bytes a pixel. `gain`: of the observer's sensitivity over the
    // model's, 0.001 to 1000; a table's is the observer's own. With the model barten_1999 the law of area is Barten's own
    // and the fall with eccentricity castleCSF's. Errors: those of judge_modern().
    static Result<SummingJudge> create(Image reference, const JudgeOptions& options, double gain = default_person.gain);

    // Of a picture of the reference's size. Cost: some 60 ns a pixel. Errors: a NaN, infinite or negative luminance, and
    // another size. Any number of threads may judge at once.
    Result<Judgement> judge(const Image& test) const;

private:
    struct State;
    explicit SummingJudge(std::shared_ptr<const State> state);
    std::shared_ptr<const State> state_; // never changes
};

} // namespace unseen::perception
