// How much better than castleCSF people see.
//
// castleCSF, with its law of area, is right for the median person: of 253 sensitivities that eight studies measured,
// 65% lie above it, the median by 1.2 dB. People differ, and the same person does from study to study: the standard
// deviation is 4.4 dB. So a person is castleCSF times a gain. The data: data/people; <unseen/calibration/internal/people.h> compares them with any model.
#pragma once

#include <array>
#include <memory>
#include <string_view>

#include <unseen/perception/csf.h>
#include <unseen/vdtree/result.h>

namespace unseen::perception {

struct Person {
    std::string_view name;
    double gain;        // of sensitivity over castleCSF's
    double share_above; // of measured sensitivities, that lie above this person's: who might see more
    double barten_gain; // of sensitivity over barten_fitted's, so that as many lie above: see second_judge_options()
    bool operator==(const Person&) const = default;
};

// Each study counts alike. Measured were still gratings, up to 30 degrees aside, of up to 100 square degrees, and from
// 1 to 500 cd/m2; beyond, castleCSF goes on by its own formulas, and so do the shares.
inline constexpr Person median_person{"median", 1, 0.649, 0.843};
inline constexpr Person default_person{"default", 2, 0.087, 1.917};
inline constexpr Person strict_person{"strict", 2.7, 0.0487, 2.129};
inline constexpr std::array people = {median_person, default_person, strict_person};

// By name; the error lists them.
Result<Person> person(std::string_view name);

// castleCSF times the gain, of still gratings. Those of `people` are made once. Precondition: a gain of 0.001 to 1000.
std::shared_ptr<const CsfTable> csf_of(const Person& person);

} // namespace unseen::perception
