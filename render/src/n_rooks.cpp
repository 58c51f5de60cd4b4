// The N-rooks pattern: the permutation of the columns decides everything.
#include <unseen/render/sample_sum.h>

#include <numeric>
#include <utility>

#include <unseen/vdtree/internal/random.h>

namespace unseen::render {

std::vector<glm::dvec2> n_rooks(int n, std::uint32_t seed) {
    if (n <= 0) return {};
    std::vector<int> row_of_column(static_cast<std::size_t>(n));
    std::iota(row_of_column.begin(), row_of_column.end(), 0);
    // The pattern must be the same everywhere, which std::shuffle does not promise. The bias of the modulus is below
    // 2^-55 for the 256 samples there can be.
    Random random(seed);
    for (std::size_t i = row_of_column.size(); i > 1; --i)
        std::swap(row_of_column[i - 1], row_of_column[random.bits() % i]);

    std::vector<glm::dvec2> points;
    points.reserve(row_of_column.size());
    for (std::size_t column = 0; column < row_of_column.size(); ++column)
        points.emplace_back((static_cast<double>(column) + 0.5) / n, (row_of_column[column] + 0.5) / n);
    return points;
}

} // namespace unseen::render
