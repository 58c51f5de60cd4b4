// The N-rooks pattern: the permutation of the columns decides everything.
#include <render/renderer.h>

#include <numeric>

namespace unseen::render {
namespace {

// SplitMix64 (Steele, Lea and Flood 2014). The pattern must be the same with every compiler and standard library, which
// std::shuffle does not promise.
class SplitMix64 {
public:
    explicit SplitMix64(std::uint64_t seed) : state_(seed) {}

    std::uint64_t next() {
        state_ += 0x9e3779b97f4a7c15u;
        std::uint64_t z = state_;
        z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
        z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
        return z ^ (z >> 31);
    }

    // Uniform over 0 .. bound-1; the bias of the modulus is below 2^-55 for the 256 samples there can be.
    std::uint64_t below(std::uint64_t bound) { return next() % bound; }

private:
    std::uint64_t state_;
};

} // namespace

std::vector<glm::dvec2> n_rooks(int n, std::uint32_t seed) {
    if (n <= 0)
        return {};
    std::vector<int> row_of_column(static_cast<std::size_t>(n));
    std::iota(row_of_column.begin(), row_of_column.end(), 0);
    SplitMix64 random(seed);
    for (std::size_t i = row_of_column.size(); i > 1; --i)
        std::swap(row_of_column[i - 1], row_of_column[random.below(i)]);

    std::vector<glm::dvec2> points;
    points.reserve(row_of_column.size());
    for (std::size_t column = 0; column < row_of_column.size(); ++column)
        points.emplace_back((static_cast<double>(column) + 0.5) / n, (row_of_column[column] + 0.5) / n);
    return points;
}

} // namespace unseen::render
