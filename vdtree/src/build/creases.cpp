#include "build/creases.h"

#include <atomic>
#include <numbers>
#include <numeric>
#include <unordered_map>

#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/parallel.h>
#include <unseen/vdtree/internal/vectors.h>

#include "build/parallel_array.h"
#include "build/spatial_order.h"

namespace unseen::vdtree {

namespace {

constexpr std::size_t block_size = 4096; // places of a task

// The rule where no angle is asked for. Edges above 30 degrees were 1.0 to 2.2 times those above 60 on 14 made things
// (castings, controllers, gears, leaves), whose own normals 30 degrees meet best; 2.9 to 74 times on 12 organic forms.
constexpr double made_degrees = 30, organic_degrees = 60, largest_ratio_of_made = 2.5;

// Scans of organic forms have a few edges above 60 degrees, which are noise: at places with 0.07 to 0.35% of the area
// (armadillo, bunny, dragon, igea). Hard, they would make seams in a surface without any. Forms with folds or made
// parts have 0.7% and more (horse, beast, gargoyle).
constexpr double least_creased_share = 0.005;

// Turned things have sides whose angles divide 360 degrees (12 sides: 30), and floats store their corners with errors.
constexpr double slack_degrees = 0.05;

// A triangle's height below this share of the mesh's extent is lost in the rounding of floats: its normal is noise.
constexpr double lost_height = 0x1p-24;

// Normals of one place that differ by less are one. In controllers' files equal ones differ by up to 0.1 degrees, for
// exporters computed each by itself; one such model has a third of the normals then. A quarter of a degree changes
// light that falls at 45 degrees by 0.4%, less than anybody sees; whole degrees join what is meant to differ.
constexpr double same_degrees = 0.25;

// Beyond so many normals at one place they are searched by a grid.
constexpr std::size_t most_in_line = 16;

double cosine_of(double degrees) { return std::cos(std::min(degrees, 180.0) * std::numbers::pi / 180); }

bool is_stated(glm::vec3 v) {
    const float sum = std::abs(v.x) + std::abs(v.y) + std::abs(v.z);
    return sum > 0 && std::isfinite(sum);
}

// ---- what is known of faces

struct FaceNormals {
    ParallelArray<glm::vec3> normals;   // by triangle; unit length; zero: no area
    ParallelArray<float> least_cosines; // by place: of the angles between its faces with an area and the mean of all
};

bool has_area(glm::vec3 normal) { return normal != glm::vec3(0); }

// -1: computed normals are turned around.
float face_sign(const CornerInput& in) { return in.surface.closedness == Closedness::closed_inward ? -1 : 1; }

FaceNormals find_face_normals(const CornerInput& in) {
    FaceNormals out{ParallelArray<glm::vec3>(in.triangles.size(), Unfilled()),
                    ParallelArray<float>(in.positions.size(), Unfilled())};
    const double least_height = in.positions.empty() ? 0 : box_around(in.positions).extent() * lost_height;
    parallel_loop(std::size_t{0}, in.triangles.size(), [&](std::size_t t) {
        const Triangle& corners = in.triangles[t];
        const glm::dvec3 &a = in.positions[corners[0]], &b = in.positions[corners[1]], &c = in.positions[corners[2]];
        const auto squared = [](const glm::dvec3& v) { return glm::dot(v, v); };
        const double longest = std::sqrt(std::max({squared(b - a), squared(c - b), squared(a - c)}));
        const FaceVector& face = in.surface.faces[t];
        const bool has_area = face.length > longest * least_height && std::isfinite(face.length);
        out.normals[t] = has_area ? glm::vec3(face.vector * (1 / face.length)) : glm::vec3(0);
    });
    parallel_loop(std::size_t{0}, in.positions.size(), [&](std::size_t place) {
        const glm::vec3 mean = face_sign(in) * in.surface.normals[place];
        float least = 1;
        for (const Index corner : in.surface.corners.at(place)) {
            const glm::vec3& normal = out.normals[corner / 3];
            if (const float cosine = glm::dot(normal, mean); cosine < least && has_area(normal)) least = cosine;
        }
        out.least_cosines[place] = least;
    });
    return out;
}

// ---- sets that are united

class CornerSets {
public:
    void reset(std::size_t count) {
        parents_.resize(count);
        std::iota(parents_.begin(), parents_.end(), Index{0});
    }
    Index find(Index i) {
        while (parents_[i] != i) i = parents_[i] = parents_[parents_[i]];
        return i;
    }
    // The lower number stands for both.
    void unite(Index a, Index b) {
        a = find(a), b = find(b);
        parents_[std::max(a, b)] = std::min(a, b);
    }

private:
    std::vector<Index> parents_;
};

// ---- edges around one place

// A corner at a place has two edges that end there. They are sorted by neighbour, then by corner.
class EdgeOfCorner {
public:
    // `neighbour`: the place at the edge's other end; later one of several that faces without an area make one edge.
    // `corner`: among those of the place. `follows`: the triangle runs from the place to the neighbour.
    EdgeOfCorner(Index neighbour, std::size_t corner, bool follows)
        : bits_(std::uint64_t{neighbour} << 32 | corner << 1 | (follows ? 1 : 0)) {}

    Index neighbour() const { return static_cast<Index>(bits_ >> 32); }
    Index corner() const { return static_cast<Index>(bits_) >> 1; } // three a triangle fill less than 31 bits here
    bool follows() const { return (bits_ & 1) != 0; }
    auto operator<=>(const EdgeOfCorner&) const = default;

private:
    std::uint64_t bits_;
};

// Looks at one place after another. Corners are numbered at the place.
class CornerFan {
public:
    CornerFan(const CornerInput& in, const FaceNormals& faces) : in_(in), faces_(faces) {}

    std::uint64_t compared = 0;

    void look_at(std::span<const Index> corners) { corners_ = corners; }

    glm::vec3 normal(Index corner) const { return faces_.normals[corners_[corner] / 3]; }

    // Calls use(edges, neighbour) for each edge.
    template <class Use>
    void for_each_edge(Use&& use) {
        collect_edges();
        for (auto run = edges_.begin(); run != edges_.end();) {
            const auto end = std::find_if(run, edges_.end(),
                                          [&](const EdgeOfCorner& e) { return e.neighbour() != run->neighbour(); });
            use(std::span(run, end), run->neighbour());
            run = end;
        }
    }

    // Unites corners across edges. Corners in smoothing groups take no part.
    void unite(double least_cosine, CornerSets& groups) {
        for_each_edge([&](std::span<EdgeOfCorner> edges, Index neighbour) {
            const auto is_solid = [&](const EdgeOfCorner& e) { return has_area(normal(e.corner())); };
            auto solid = std::ranges::find_if_not(edges, is_solid);
            if (solid != edges.end()) solid = std::stable_partition(solid, edges.end(), is_solid);
            const auto faces = static_cast<std::size_t>(solid - edges.begin());
            if (faces == 2 && is_smooth(edges[0].corner(), edges[1].corner(), least_cosine))
                groups.unite(edges[0].corner(), edges[1].corner());
            if (faces > 2) unite_around(edges.first(faces), neighbour, least_cosine, groups);
        });
        join_faces_without_area(groups);
    }

    // Unites corners of one smoothing group.
    void unite_smoothing_groups(CornerSets& groups) {
        numbers_.clear();
        for (std::size_t i = 0; i < corners_.size(); ++i)
            if (const Index number = in_.smoothing[corners_[i] / 3]; number != 0)
                numbers_.emplace_back(number, static_cast<Index>(i));
        std::sort(numbers_.begin(), numbers_.end());
        for (std::size_t i = 1; i < numbers_.size(); ++i)
            if (numbers_[i].first == numbers_[i - 1].first) groups.unite(numbers_[i - 1].second, numbers_[i].second);
    }

    // Whether two corners' faces may share a normal.
    bool is_smooth(Index a, Index b, double least_cosine) {
        ++compared;
        return glm::dot(glm::dvec3(normal(a)), glm::dvec3(normal(b))) >= least_cosine;
    }

private:
    void collect_edges() {
        edges_.clear();
        bool all_solid = true;
        for (std::size_t i = 0; i < corners_.size(); ++i) {
            if (!in_.smoothing.empty() && in_.smoothing[corners_[i] / 3] != 0) continue;
            const auto [following, preceding] = neighbours_of(i);
            edges_.emplace_back(following, i, true);
            edges_.emplace_back(preceding, i, false);
            all_solid = all_solid && has_area(normal(static_cast<Index>(i)));
        }
        std::sort(edges_.begin(), edges_.end());
        if (!all_solid) close_slivers();
    }

    std::pair<Index, Index> neighbours_of(std::size_t corner) const {
        const Triangle& places = in_.triangles[corners_[corner] / 3];
        const std::size_t k = corners_[corner] % 3;
        return {places[(k + 1) % 3], places[(k + 2) % 3]};
    }

    // The two edges of a face without an area become one.
    void close_slivers() {
        neighbours_.clear();
        for (const EdgeOfCorner& e : edges_)
            if (neighbours_.empty() || neighbours_.back() != e.neighbour()) neighbours_.push_back(e.neighbour());
        const auto number = [&](Index neighbour) {
            return static_cast<Index>(std::lower_bound(neighbours_.begin(), neighbours_.end(), neighbour) -
                                      neighbours_.begin());
        };
        ends_.reset(neighbours_.size());
        for (const EdgeOfCorner& e : edges_) {
            if (has_area(normal(e.corner()))) continue;
            const auto [following, preceding] = neighbours_of(e.corner());
            ends_.unite(number(following), number(preceding));
        }
        for (EdgeOfCorner& e : edges_)
            e = EdgeOfCorner(neighbours_[ends_.find(number(e.neighbour()))], e.corner(), e.follows());
        std::sort(edges_.begin(), edges_.end());
    }

    // Any two of the faces around an edge. Their normals lie on a circle, so it suffices to compare those that follow
    // each other there.
    void unite_around(std::span<EdgeOfCorner> edges, Index neighbour, double least_cosine, CornerSets& groups) {
        constexpr std::size_t most_in_pairs = 4; // there it takes no angles
        if (edges.size() <= most_in_pairs) {
            for (std::size_t i = 0; i < edges.size(); ++i)
                for (std::size_t j = 0; j < i; ++j)
                    if (is_smooth(edges[i].corner(), edges[j].corner(), least_cosine))
                        groups.unite(edges[i].corner(), edges[j].corner());
            return;
        }
        const Index place = in_.triangles[corners_[0] / 3][corners_[0] % 3];
        const glm::dvec3 axis = unit(in_.positions[neighbour] - in_.positions[place]);
        const glm::dvec3 aside = std::abs(axis.x) < 0.7 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
        const glm::dvec3 first = unit(glm::cross(axis, aside)), second = glm::cross(axis, first);
        angles_.clear();
        for (const EdgeOfCorner& e : edges) {
            const glm::dvec3 n(normal(e.corner()));
            angles_.emplace_back(std::atan2(glm::dot(n, second), glm::dot(n, first)), e.corner());
        }
        std::sort(angles_.begin(), angles_.end());
        Index before = angles_.back().second;
        for (const auto& [angle, corner] : angles_) {
            if (is_smooth(before, corner, least_cosine)) groups.unite(before, corner);
            before = corner;
        }
    }

    // To a face across their edge, else to any at the place. None of them joins two groups.
    void join_faces_without_area(CornerSets& groups) {
        if (edges_.empty()) return;
        const auto solid =
            std::ranges::find_if(edges_, [&](const EdgeOfCorner& e) { return has_area(normal(e.corner())); });
        const Index any = (solid == edges_.end() ? edges_.front() : *solid).corner();
        Index edge = edges_.front().neighbour(), host = any;
        for (auto e = edges_.begin(); e != edges_.end(); ++e) {
            const bool begins = e == edges_.begin() || e->neighbour() != edge;
            edge = e->neighbour();
            const bool is_solid = has_area(normal(e->corner())); // these come first at each edge
            if (begins) host = is_solid ? e->corner() : any;
            if (!is_solid) groups.unite(host, e->corner()); // both edges of the face are this one
        }
    }

    const CornerInput& in_;
    const FaceNormals& faces_;
    std::span<const Index> corners_;
    std::vector<EdgeOfCorner> edges_;
    std::vector<Index> neighbours_;
    std::vector<std::pair<double, Index>> angles_;
    std::vector<std::pair<Index, Index>> numbers_; // of smoothing groups, and corners
    CornerSets ends_;
};

// ---- the rule

struct EdgeCounts {
    std::uint64_t above_made = 0, above_organic = 0;
};

// Edges of two faces, each counted at the end with the lower number.
EdgeCounts count_edges(const CornerInput& in, const FaceNormals& faces) {
    const double made = cosine_of(made_degrees + slack_degrees), organic = cosine_of(organic_degrees + slack_degrees);
    const double no_edges = cosine_of(made_degrees / 2);
    std::atomic<std::uint64_t> above_made = 0, above_organic = 0;
    parallel_loop_over(tbb::blocked_range<std::size_t>(0, in.positions.size(), block_size), [&](const auto& places) {
        CornerFan fan(in, faces);
        EdgeCounts counts;
        for (std::size_t place = places.begin(); place < places.end(); ++place) {
            if (static_cast<double>(faces.least_cosines[place]) >= no_edges) continue;
            fan.look_at(in.surface.corners.at(place));
            fan.for_each_edge([&](std::span<const EdgeOfCorner> edges, Index neighbour) {
                if (edges.size() != 2 || neighbour < place || edges[0].follows() == edges[1].follows()) return;
                const Index a = edges[0].corner(), b = edges[1].corner();
                if (!has_area(fan.normal(a)) || !has_area(fan.normal(b))) return;
                counts.above_made += !fan.is_smooth(a, b, made);
                counts.above_organic += !fan.is_smooth(a, b, organic);
            });
        }
        above_made.fetch_add(counts.above_made, std::memory_order_relaxed);
        above_organic.fetch_add(counts.above_organic, std::memory_order_relaxed);
    });
    return {above_made.load(), above_organic.load()};
}

double angle_by_rule(const EdgeCounts& edges) {
    const bool is_made =
        static_cast<double>(edges.above_made) <= largest_ratio_of_made * static_cast<double>(edges.above_organic);
    return is_made ? made_degrees : organic_degrees;
}

// ---- normals of one place

// Numbers different normals in the order in which they come; one that is nearly another gets its number.
class DifferentNormals {
public:
    explicit DifferentNormals(std::vector<glm::vec3>& normals) : normals_(normals) {}

    std::uint64_t compared = 0;

    // At a new place.
    void begin() { begin_ = normals_.size(), cells_.clear(); }
    std::size_t count() const { return normals_.size() - begin_; }

    std::size_t number_of(glm::vec3 normal) {
        const std::size_t found = count() > most_in_line ? find_in_grid(normal) : find_in_line(normal);
        if (found != none) return found;
        normals_.push_back(normal);
        if (count() == most_in_line + 1)
            for (std::size_t i = begin_; i < normals_.size(); ++i) enter(i);
        else if (count() > most_in_line) enter(normals_.size() - 1);
        return normals_.size() - 1;
    }

private:
    static constexpr std::size_t none = ~std::size_t{0};
    static constexpr double cell_ = same_degrees * std::numbers::pi / 180; // side; chords are shorter than their arcs

    bool is_same(std::size_t number, glm::vec3 normal) {
        ++compared;
        const glm::vec3& other = normals_[number];
        return other == normal ||
               (has_area(normal) && glm::dot(glm::dvec3(other), glm::dvec3(normal)) >= least_cosine_);
    }
    std::size_t find_in_line(glm::vec3 normal) {
        for (std::size_t i = begin_; i < normals_.size(); ++i)
            if (is_same(i, normal)) return i;
        return none;
    }
    // The same as in line: the lowest number.
    std::size_t find_in_grid(glm::vec3 normal) {
        std::size_t found = none;
        const glm::ivec3 at = cell_of(normal);
        for (int x = -1; x <= 1; ++x)
            for (int y = -1; y <= 1; ++y)
                for (int z = -1; z <= 1; ++z) {
                    const auto cell = cells_.find(key(at + glm::ivec3(x, y, z)));
                    if (cell == cells_.end()) continue;
                    for (const std::size_t i : cell->second)
                        if (i < found && is_same(i, normal)) found = i;
                }
        return found;
    }
    void enter(std::size_t number) { cells_[key(cell_of(normals_[number]))].push_back(number); }

    static glm::ivec3 cell_of(glm::vec3 normal) { return glm::ivec3(glm::floor(glm::dvec3(normal) / cell_)); }
    static std::uint64_t key(glm::ivec3 cell) {
        std::uint64_t key = 0;
        for (int axis = 0; axis < 3; ++axis) key = key << 21 | static_cast<std::uint32_t>(cell[axis] + (1 << 20));
        return key;
    }

    std::vector<glm::vec3>& normals_;
    std::size_t begin_ = 0;
    std::unordered_map<std::uint64_t, std::vector<std::size_t>> cells_;
    const double least_cosine_ = cosine_of(same_degrees);
};

// Makes the normals of a block of places and numbers them, the first one 0.
class NormalBlock {
public:
    // `degrees`: larger angles are creases.
    NormalBlock(const CornerInput& in, const FaceNormals& faces, double degrees, std::span<Index> number)
        : in_(in), fan_(in, faces), faces_(faces), number_(number), is_smooth_(degrees >= 180),
          least_cosine_(cosine_of(degrees + slack_degrees)), within_(cosine_of(degrees / 2)) {}

    std::vector<glm::vec3> normals;
    double area = 0, creased_area = 0; // of the places, and of those with several normals

    std::uint64_t compared() const { return fan_.compared + different_.compared; }

    void add(Index place) {
        const std::span<const Index> corners = in_.surface.corners.at(place);
        if (corners.empty()) return;
        area += in_.surface.areas[place];
        const bool is_one =
            in_.smoothing.empty() && (is_smooth_ || static_cast<double>(faces_.least_cosines[place]) >= within_);
        if (is_one && in_.own.empty()) {
            for (const Index corner : corners) number_[corner] = static_cast<Index>(normals.size());
            normals.push_back(in_.surface.normals[place]);
            return;
        }
        different_.begin();
        if (!is_one) group(corners);
        first_.assign(corners.size(), none);
        for (std::size_t i = 0; i < corners.size(); ++i) {
            const Index corner = corners[i];
            if (has_own(corner)) {
                const glm::vec3 own = in_.own_sign * glm::vec3(unit(glm::dvec3(in_.own[corner])));
                number_[corner] = static_cast<Index>(different_.number_of(own));
                continue;
            }
            const Index g = is_one ? 0 : groups_.find(static_cast<Index>(i));
            if (first_[g] == none)
                first_[g] = static_cast<Index>(different_.number_of(
                    is_one ? in_.surface.normals[place] : face_sign(in_) * glm::vec3(unit(sums_[g]))));
            number_[corner] = first_[g];
        }
        if (different_.count() > 1) creased_area += in_.surface.areas[place];
    }

private:
    static constexpr Index none = ~Index{0};

    bool has_own(Index corner) const { return !in_.own.empty() && is_stated(in_.own[corner]); }

    // Which corners share a computed normal.
    void group(std::span<const Index> corners) {
        if (std::ranges::all_of(corners, [&](Index corner) { return has_own(corner); })) return;
        fan_.look_at(corners);
        const bool stated = !in_.smoothing.empty();
        groups_.reset(corners.size());
        fan_.unite(stated ? flat_ : least_cosine_, groups_);
        if (stated) fan_.unite_smoothing_groups(groups_);
        sums_.assign(corners.size(), glm::dvec3(0));
        for (std::size_t i = 0; i < corners.size(); ++i)
            sums_[groups_.find(static_cast<Index>(i))] += in_.surface.faces[corners[i] / 3].vector;
    }

    const CornerInput& in_;
    CornerFan fan_;
    const FaceNormals& faces_;
    std::span<Index> number_;
    DifferentNormals different_{normals};
    const bool is_smooth_;
    const double least_cosine_, within_, flat_ = cosine_of(slack_degrees);
    CornerSets groups_;
    std::vector<glm::dvec3> sums_; // by the group's first corner
    std::vector<Index> first_;     // likewise: the number of its normal
};

// ---- the whole mesh

// Fills all of `out` but `creases`, which says what the angle is. Returns the share of the area at places with several
// normals; NaN without an area.
double number_corners(const CornerInput& input, const FaceNormals& faces, CornerNormals& out) {
    struct Block {
        std::vector<glm::vec3> normals;
        double area, creased_area;
        std::size_t begin;
    };
    const std::size_t places = input.positions.size();
    std::vector<Block> blocks((places + block_size - 1) / block_size);
    const auto for_each_place = [&](std::size_t block, auto&& use) {
        for (std::size_t p = block * block_size; p < std::min(places, (block + 1) * block_size); ++p)
            use(static_cast<Index>(p));
    };
    std::atomic<std::uint64_t> compared = out.compared;
    parallel_loop(std::size_t{0}, blocks.size(), [&](std::size_t b) {
        NormalBlock block(input, faces, static_cast<double>(out.creases.degrees), out.number);
        for_each_place(b, [&](Index place) { block.add(place); });
        compared.fetch_add(block.compared(), std::memory_order_relaxed);
        blocks[b] = {std::move(block.normals), block.area, block.creased_area, 0};
    });
    std::size_t count = 0, used = 0;
    double area = 0, creased_area = 0;
    for (Block& block : blocks) {
        block.begin = count;
        count += block.normals.size();
        area += block.area, creased_area += block.creased_area;
    }
    for (std::size_t p = 0; p < places; ++p) used += !input.surface.corners.at(p).empty();
    out.normals.resize(count);
    parallel_loop(std::size_t{0}, blocks.size(), [&](std::size_t b) {
        std::ranges::copy(blocks[b].normals, out.normals.begin() + static_cast<std::ptrdiff_t>(blocks[b].begin));
        for_each_place(b, [&](Index place) {
            for (const Index corner : input.surface.corners.at(place))
                out.number[corner] += static_cast<Index>(blocks[b].begin);
        });
    });
    out.has_creases = count > used;
    out.compared = compared.load();
    return creased_area / area;
}

} // namespace

CornerNormals find_corner_normals(const CornerInput& input) {
    const bool all_own = !input.own.empty() && std::ranges::all_of(input.own, is_stated);
    const FaceNormals faces = all_own ? FaceNormals() : find_face_normals(input);
    CornerNormals out;
    out.compared = all_own ? 0 : input.triangles.size() * 3;
    if (all_own || !input.smoothing.empty()) out.creases = {};
    else if (input.crease) out.creases = {Creases::Source::asked, std::min(*input.crease, 180.0f)};
    else out.creases = {Creases::Source::rule, static_cast<float>(angle_by_rule(count_edges(input, faces)))};
    out.number.resize(input.triangles.size() * 3);
    const double share = number_corners(input, faces, out);
    const bool is_organic = out.creases == Creases{Creases::Source::rule, static_cast<float>(organic_degrees)};
    if (is_organic && out.has_creases && share < least_creased_share) {
        out.creases.degrees = 180;
        number_corners(input, faces, out);
    }
    return out;
}

Result<void> check_crease(const std::optional<float>& degrees) {
    if (!degrees || (*degrees >= 0 && *degrees <= 180)) return {};
    return invalid_argument(
        "The crease angle must be from 0 to 180 degrees; leave it out to have it follow from the mesh.");
}

} // namespace unseen::vdtree
