#include "suggestion.h"

#include <algorithm>

namespace unseen::app {
namespace {

// Letters to insert, leave out, replace or swap with their neighbour (optimal string alignment).
std::size_t slips(std::string_view a, std::string_view b) {
    std::vector<std::vector<std::size_t>> d(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
    for (std::size_t i = 0; i <= a.size(); ++i) d[i][0] = i;
    for (std::size_t k = 0; k <= b.size(); ++k) d[0][k] = k;
    for (std::size_t i = 1; i <= a.size(); ++i) {
        for (std::size_t k = 1; k <= b.size(); ++k) {
            const bool is_other = a[i - 1] != b[k - 1];
            d[i][k] = std::min({d[i - 1][k] + 1, d[i][k - 1] + 1, d[i - 1][k - 1] + is_other});
            if (i > 1 && k > 1 && a[i - 1] == b[k - 2] && a[i - 2] == b[k - 1])
                d[i][k] = std::min(d[i][k], d[i - 2][k - 2] + 1);
        }
    }
    return d[a.size()][b.size()];
}

} // namespace

std::string suggestion(std::string_view typed, const std::vector<std::string>& names) {
    constexpr std::size_t longest = 40, letters_a_slip = 3; // a third of the letters may be wrong
    if (typed.size() > longest) return {};
    std::size_t least = std::max<std::size_t>(1, typed.size() / letters_a_slip) + 1;
    const std::string* nearest = nullptr;
    for (const std::string& name : names) {
        const std::size_t count = slips(typed, name);
        if (count >= least) continue;
        least = count;
        nearest = &name;
    }
    return nearest ? ": did you mean '" + *nearest + "'?" : std::string();
}

} // namespace unseen::app
