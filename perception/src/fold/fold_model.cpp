#include <unseen/perception/criterion.h>

#include <algorithm>
#include <cmath>
#include <string>

namespace unseen::perception {

double needed_sensitivity(const FoldModel& model, Degrees eccentricity) {
    const auto& at = FoldModel::needed_at_degrees;
    const double e = std::clamp(eccentricity.value(), at.front(), at.back());
    std::size_t i = 0;
    while (i + 2 < at.size() && e > at[i + 1]) ++i;
    return std::lerp(model.needed[i], model.needed[i + 1], (e - at[i]) / (at[i + 1] - at[i]));
}

Result<void> validate(const FoldModel& m) {
    for (const double factor : {m.neighbourhood, m.needed_by_outlines, m.contact_reach, m.least_sine})
        if (!(factor >= 0 && std::isfinite(factor)))
            return Error{ErrorCode::invalid_argument, "fold test: the model's factors must be finite, and 0 or more"};
    for (std::size_t i = 0; i < m.needed.size(); ++i)
        if (!(m.needed[i] > 0 && m.needed[i] <= (i > 0 ? m.needed[i - 1] : 1e3)))
            return Error{ErrorCode::invalid_argument, "fold test: the sensitivity needed, model.needed[" +
                                                          std::to_string(i) +
                                                          "], must be above 0 and not rise with the eccentricity"};
    if (m.neighbourhood == 0 || m.needed_by_outlines == 0)
        return Error{ErrorCode::invalid_argument,
                     "fold test: the model's neighbourhood and needed_by_outlines must be above 0"};
    return {};
}

} // namespace unseen::perception
