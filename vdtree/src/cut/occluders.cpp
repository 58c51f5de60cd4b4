// A grid over the mesh: the cells that the surface touches, the others parted into connected rooms, each of which lies
// inside or outside as a whole. Then every inner cell's distance from the nearest cell that is not, and the largest
// spheres that lie apart.
#include <unseen/vdtree/criteria.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

namespace unseen::vdtree {

namespace {

constexpr int fewest_cells = 8, most_cells = 512;
constexpr int border = 2; // free cells around the mesh
// Columns are counted through points a little off their middles, in cells: meshes are often made on grids, and a line
// through an edge counts nothing.
constexpr double off_middle_y = 0.0131, off_middle_z = -0.0217;
// A room lies inside if this share of its columns says so. (All should, but a line may pass through an edge.)
constexpr double most_of_a_room = 0.9;
constexpr int least_radius = 1; // cells
// Spheres whose middles lie in a larger one, or nearly, hide little more.
constexpr float apart = 0.9f;

class Grid {
public:
    Grid(const SoundTree& tree, int cells) : tree_(tree), side_(cells) {
        glm::dvec3 low(std::numeric_limits<double>::infinity()), high = -low;
        for (const glm::vec3& p : tree.positions().subspan(tree.interior_count()))
            low = glm::min(low, glm::dvec3(p)), high = glm::max(high, glm::dvec3(p));
        const glm::dvec3 size = high - low;
        cell_ = std::max({size.x, size.y, size.z}) / (side_ - 2 * border);
        corner_ = low - border * cell_;
        touched_.assign(index(0, 0, side_), 0);
    }

    bool is_empty() const { return !(cell_ > 0) || !std::isfinite(cell_); }

    std::vector<Sphere> spheres(int count) {
        std::vector<std::vector<Crossing>> columns(index(0, side_, 0));
        for (const Triangle& t : tree_.triangles()) enter(t, columns);
        find_distances(inner_cells(columns));
        return largest(count);
    }

private:
    struct Crossing {
        double x;
        int turn; // 1: from the front, -1: from the back
    };
    enum class Side : std::uint8_t { unknown, outside, inside };

    std::size_t index(int x, int y, int z) const {
        return (static_cast<std::size_t>(z) * side() + static_cast<std::size_t>(y)) * side() +
               static_cast<std::size_t>(x);
    }
    std::size_t side() const { return static_cast<std::size_t>(side_); }

    void enter(const Triangle& t, std::vector<std::vector<Crossing>>& columns) {
        glm::dvec3 p[3];
        for (std::size_t k = 0; k < 3; ++k)
            p[k] = (glm::dvec3(tree_.positions()[tree_.wedge_of_leaf(t[k])]) - corner_) / cell_;
        const glm::dvec3 low = glm::min(p[0], glm::min(p[1], p[2])), high = glm::max(p[0], glm::max(p[1], p[2]));
        const glm::ivec3 first = glm::ivec3(glm::floor(low - rounding)), last = glm::ivec3(glm::floor(high + rounding));
        const glm::dvec3 n = glm::cross(p[1] - p[0], p[2] - p[0]);
        // Cells that the plane does not reach are not touched.
        const double reach =
            0.5 * (std::abs(n.x) + std::abs(n.y) + std::abs(n.z)) * (1 + rounding) + rounding * glm::length(n);
        for (int z = first.z; z <= last.z; ++z)
            for (int y = first.y; y <= last.y; ++y)
                for (int x = first.x; x <= last.x; ++x)
                    if (!(std::abs(glm::dot(n, glm::dvec3(x, y, z) + 0.5 - p[0])) > reach))
                        touched_[index(x, y, z)] = 1;
        for (int z = first.z; z <= last.z; ++z)
            for (int y = first.y; y <= last.y; ++y) cross(p, y, z, columns);
    }

    // Where the column's line passes through the triangle.
    void cross(const glm::dvec3 (&p)[3], int y, int z, std::vector<std::vector<Crossing>>& columns) const {
        const double at_y = y + 0.5 + off_middle_y, at_z = z + 0.5 + off_middle_z;
        double part[3];
        for (int k = 0; k < 3; ++k) {
            const glm::dvec3 &a = p[(k + 1) % 3], &b = p[(k + 2) % 3];
            part[k] = (a.y - at_y) * (b.z - at_z) - (a.z - at_z) * (b.y - at_y);
        }
        const bool is_front = part[0] > 0 && part[1] > 0 && part[2] > 0,
                   is_back = part[0] < 0 && part[1] < 0 && part[2] < 0;
        if (!is_front && !is_back) return;
        const double x = (part[0] * p[0].x + part[1] * p[1].x + part[2] * p[2].x) / (part[0] + part[1] + part[2]);
        columns[index(y, z, 0)].push_back({x, is_front ? 1 : -1});
    }

    // What the columns say of their cells, by winding numbers; of columns whose ends disagree, nothing.
    std::vector<Side> sides(std::vector<std::vector<Crossing>>& columns) const {
        std::vector<Side> sides(touched_.size(), Side::unknown);
        for (int z = 0; z < side_; ++z) {
            for (int y = 0; y < side_; ++y) {
                auto& column = columns[index(y, z, 0)];
                std::sort(column.begin(), column.end(), [](const Crossing& a, const Crossing& b) { return a.x < b.x; });
                int winding = 0;
                for (const Crossing& c : column) winding += c.turn;
                if (winding != 0) continue;
                auto next = column.begin();
                for (int x = 0; x < side_; ++x) {
                    for (; next != column.end() && next->x < x + 0.5; ++next) winding += next->turn;
                    sides[index(x, y, z)] = winding != 0 ? Side::inside : Side::outside;
                }
            }
        }
        return sides;
    }

    std::vector<std::uint8_t> inner_cells(std::vector<std::vector<Crossing>>& columns) const {
        const std::vector<Side> said = sides(columns);
        std::vector<std::uint8_t> is_inner(touched_.size(), 0), is_done = touched_;
        std::vector<std::size_t> room;
        for (std::size_t start = 0; start < is_done.size(); ++start) {
            if (is_done[start]) continue;
            room.assign(1, start);
            is_done[start] = 1;
            std::size_t inside = 0, outside = 0;
            for (std::size_t i = 0; i < room.size(); ++i) {
                inside += said[room[i]] == Side::inside;
                outside += said[room[i]] == Side::outside;
                for_each_neighbour(room[i], [&](std::size_t cell) {
                    if (!is_done[cell]) is_done[cell] = 1, room.push_back(cell);
                });
            }
            if (static_cast<double>(inside) > most_of_a_room * static_cast<double>(inside + outside))
                for (const std::size_t cell : room) is_inner[cell] = 1;
        }
        return is_inner;
    }

    template <class F>
    void for_each_neighbour(std::size_t cell, F&& f) const {
        const std::size_t steps[] = {1, side(), side() * side()};
        std::size_t rest = cell;
        for (const std::size_t step : steps) {
            const std::size_t at = rest % side();
            rest /= side();
            if (at > 0) f(cell - step);
            if (at + 1 < side()) f(cell + step);
        }
    }

    // Squared distances of the cells' middles from the nearest cell that is not an inner one, in half cells. The squares
    // add up axis by axis.
    void find_distances(const std::vector<std::uint8_t>& is_inner) {
        squared_.resize(is_inner.size());
        for (std::size_t row = 0; row < is_inner.size(); row += side()) {
            const auto sweep = [&](auto at) {
                std::int32_t cells = 0; // since the last cell that is not an inner one, such as the grid's border
                for (std::size_t x = 0; x < side(); ++x) {
                    cells = is_inner[row + at(x)] ? cells + 1 : 0;
                    const std::int32_t way = std::max(2 * cells - 1, 0);
                    squared_[row + at(x)] = std::min(squared_[row + at(x)], way * way);
                }
            };
            std::fill_n(squared_.begin() + static_cast<std::ptrdiff_t>(row), side(),
                        std::numeric_limits<std::int32_t>::max());
            sweep([](std::size_t x) { return x; });
            sweep([&](std::size_t x) { return side() - 1 - x; });
        }
        for (std::size_t i = 0; i < side(); ++i) join_rows(i * side() * side(), side());
        for (std::size_t i = 0; i < side(); ++i) join_rows(i * side(), side() * side());
    }

    // Joins rows along x that begin at equal steps: from each row outwards, until no row is near enough to matter.
    void join_rows(std::size_t first, std::size_t step) {
        std::vector<std::int32_t> before(side() * side());
        for (std::size_t row = 0; row < side(); ++row)
            std::copy_n(&squared_[first + row * step], side(), &before[row * side()]);
        for (std::size_t to = 0; to < side(); ++to) {
            std::int32_t* const joined = &squared_[first + to * step];
            for (std::size_t rows = 1; rows < side(); ++rows) {
                const auto way = static_cast<std::int32_t>(2 * rows - 1), between = way * way;
                std::int32_t most = 0;
                for (std::size_t x = 0; x < side(); ++x) most = std::max(most, joined[x]);
                if (most <= between) break;
                const auto join = [&](std::size_t from) {
                    const std::int32_t* const row = &before[from * side()];
                    for (std::size_t x = 0; x < side(); ++x) joined[x] = std::min(joined[x], row[x] + between);
                };
                if (to >= rows) join(to - rows);
                if (to + rows < side()) join(to + rows);
            }
        }
    }

    std::vector<Sphere> largest(int count) const {
        std::vector<Sphere> chosen;
        while (chosen.size() < static_cast<std::size_t>(count)) {
            constexpr std::int32_t least = 4 * least_radius * least_radius;
            std::int32_t most = least;
            glm::vec3 best(0);
            for (std::size_t cell = 0; cell < squared_.size(); ++cell) {
                if (squared_[cell] <= most) continue;
                const glm::vec3 centre = middle_of(cell);
                const bool is_apart = std::all_of(chosen.begin(), chosen.end(), [&](const Sphere& larger) {
                    return glm::length(larger.centre - centre) >= apart * larger.radius;
                });
                if (is_apart) most = squared_[cell], best = centre;
            }
            if (most == least) break;
            const double radius = std::sqrt(static_cast<double>(most)) / 2 * cell_;
            chosen.push_back({best, static_cast<float>(radius * (1 - rounding))});
        }
        return chosen;
    }

    glm::vec3 middle_of(std::size_t cell) const {
        const glm::dvec3 at(static_cast<double>(cell % side()), static_cast<double>(cell / side() % side()),
                            static_cast<double>(cell / side() / side()));
        return glm::vec3(corner_ + (at + 0.5) * cell_);
    }

    static constexpr double rounding = 1e-5; // cells: more than positions are rounded by, in floats

    const SoundTree& tree_;
    int side_;                          // cells along each axis
    double cell_ = 0;                   // mesh units
    glm::dvec3 corner_ = glm::dvec3(0); // of the first cell
    std::vector<std::uint8_t> touched_;
    std::vector<std::int32_t> squared_; // distances, in half cells
};

} // namespace

std::vector<Sphere> inner_spheres(const VertexTree& tree, int count, int cells) {
    if (tree.closedness() == Closedness::open || count <= 0) return {};
    const auto sound = SoundTree::of(tree);
    if (!sound) return {};
    Grid grid(*sound, std::clamp(cells, fewest_cells, most_cells) + 2 * border);
    return grid.is_empty() ? std::vector<Sphere>{} : grid.spheres(count);
}

double winding_number(const VertexTree& tree, glm::dvec3 at) {
    const auto sound = SoundTree::of(tree);
    if (!sound) return std::numeric_limits<double>::quiet_NaN();
    double sum = 0;
    for (const Triangle& t : sound->triangles()) {
        glm::dvec3 p[3];
        for (std::size_t k = 0; k < 3; ++k) p[k] = glm::dvec3(tree.positions()[sound->wedge_of_leaf(t[k])]) - at;
        const double a = glm::length(p[0]), b = glm::length(p[1]), c = glm::length(p[2]);
        sum +=
            2 * std::atan2(glm::dot(p[0], glm::cross(p[1], p[2])),
                           a * b * c + glm::dot(p[0], p[1]) * c + glm::dot(p[1], p[2]) * a + glm::dot(p[2], p[0]) * b);
    }
    return sum / (4 * std::numbers::pi);
}

} // namespace unseen::vdtree
