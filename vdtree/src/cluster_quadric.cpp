// Pair contraction by quadric error over position and luminance.
//
// Every vertex carries a quadric over (x, y, z, luminance): the squared distance from the planes that its triangles
// span there (Garland and Heckbert 1998), plus, with small weights, the squared distance from the vertices themselves, which keeps
// clusters compact and of like luminance where the planes do not care. Contraction runs in rounds: each cluster chooses its
// best partner, pairs that choose each other are contracted in ascending error, and the errors are computed anew. That is nearest-neighbour agglomeration: the hierarchy differs little from strictly greedy order, but the work is
// linear a round, cache-friendly, and the tree is balanced.
#include <vdtree/builder.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <span>

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec4.hpp>
#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

namespace unseen::vdtree {

namespace {

// One unit of relative luminance counts as this share of the model's extent. The best of 0.02, 0.05, 0.1 and 0.2 on the
// bunny under the perceptual fold test; they differ by 0.3% of its triangles.
constexpr double luminance_scale = 0.2;
// Weight of the squared distance between a cluster's vertices and its proxy, against that from the planes.
constexpr double compactness = 0.01;
// Weight of the variance of luminance within a cluster, against the deviation from the interpolated luminance.
constexpr double luminance_compactness = 0.1;
// Weight of the planes that stand on boundary edges, against those of triangles.
constexpr double boundary_weight = 4;
// Across a gap that no edge bridges, the full squared distance counts: joining two parts moves both.
constexpr double gap_weight = 1;
// A round that contracts a smaller share of the clusters takes second-best pairs too: errors that grow along a chain
// would otherwise contract one pair a round.
constexpr std::size_t least_round_share = 16; // one in so many

// A symmetric quadratic form over 4-space: E(x) = x'Ax - 2 b'x + c, and the weight (area) that went into it.
struct Quadric {
    // Upper triangle of A, row by row.
    std::array<double, 10> a{};
    glm::dvec4 b{0};
    double c = 0;
    double weight = 0;

    void operator+=(const Quadric& o) {
        for (std::size_t i = 0; i < a.size(); ++i) a[i] += o.a[i];
        b += o.b;
        c += o.c;
        weight += o.weight;
    }
    glm::dvec4 times(glm::dvec4 x) const {
        return {a[0] * x[0] + a[1] * x[1] + a[2] * x[2] + a[3] * x[3], a[1] * x[0] + a[4] * x[1] + a[5] * x[2] + a[6] * x[3],
                a[2] * x[0] + a[5] * x[1] + a[7] * x[2] + a[8] * x[3], a[3] * x[0] + a[6] * x[1] + a[8] * x[2] + a[9] * x[3]};
    }
    double error(glm::dvec4 x) const { return std::max(0.0, glm::dot(x, times(x)) - 2 * glm::dot(b, x) + c); }
};

// Squared distance from the 2-plane through p spanned by the orthonormal e, f.
void add_plane(Quadric& q, glm::dvec4 p, glm::dvec4 e, glm::dvec4 f, double weight) {
    std::size_t k = 0;
    for (int i = 0; i < 4; ++i)
        for (int j = i; j < 4; ++j) q.a[k++] += weight * ((i == j ? 1.0 : 0.0) - e[i] * e[j] - f[i] * f[j]);
    const glm::dvec4 normal_part = p - glm::dot(p, e) * e - glm::dot(p, f) * f;
    q.b += weight * normal_part;
    q.c += weight * glm::dot(p, normal_part);
}

// Squared distance from the hyperplane n.x = d.
void add_hyperplane(Quadric& q, glm::dvec4 n, double d, double weight) {
    std::size_t k = 0;
    for (int i = 0; i < 4; ++i)
        for (int j = i; j < 4; ++j) q.a[k++] += weight * n[i] * n[j];
    q.b += weight * d * n;
    q.c += weight * d * d;
}

// Squared distance from the point p, with a weight for position and one for luminance.
void add_point(Quadric& q, glm::dvec4 p, double position_weight, double luminance_weight_here) {
    const glm::dvec4 w(position_weight, position_weight, position_weight, luminance_weight_here);
    q.a[0] += w[0], q.a[4] += w[1], q.a[7] += w[2], q.a[9] += w[3];
    q.b += w * p;
    q.c += glm::dot(w * p, p);
}

// The point of least error, by Cholesky; false where the form is too flat to tell.
bool minimise(const Quadric& q, glm::dvec4& x) {
    const double floor = 1e-12 * (q.a[0] + q.a[4] + q.a[7] + q.a[9]);
    const auto& a = q.a;
    if (!(a[0] > floor)) return false;
    const double l00 = std::sqrt(a[0]), i0 = 1 / l00, l10 = a[1] * i0, l20 = a[2] * i0, l30 = a[3] * i0;
    const double d1 = a[4] - l10 * l10;
    if (!(d1 > floor)) return false;
    const double l11 = std::sqrt(d1), i1 = 1 / l11, l21 = (a[5] - l20 * l10) * i1, l31 = (a[6] - l30 * l10) * i1;
    const double d2 = a[7] - l20 * l20 - l21 * l21;
    if (!(d2 > floor)) return false;
    const double l22 = std::sqrt(d2), i2 = 1 / l22, l32 = (a[8] - l30 * l20 - l31 * l21) * i2;
    const double d3 = a[9] - l30 * l30 - l31 * l31 - l32 * l32;
    if (!(d3 > floor)) return false;
    const double i3 = 1 / std::sqrt(d3);
    const double y0 = q.b[0] * i0, y1 = (q.b[1] - l10 * y0) * i1, y2 = (q.b[2] - l20 * y0 - l21 * y1) * i2;
    const double y3 = (q.b[3] - l30 * y0 - l31 * y1 - l32 * y2) * i3;
    x[3] = y3 * i3;
    x[2] = (y2 - l32 * x[3]) * i2;
    x[1] = (y1 - l21 * x[2] - l31 * x[3]) * i1;
    x[0] = (y0 - l10 * x[1] - l20 * x[2] - l30 * x[3]) * i0;
    return true;
}

struct Pair {
    Index a, b; // live cluster slots, a < b
    bool operator<(const Pair& o) const { return a != o.a ? a < o.a : b < o.b; }
    bool operator==(const Pair&) const = default;
};

class QuadricClusterer {
public:
    QuadricClusterer(const ClusterInput& input, const Progress& progress) : input_(input), progress_(progress) {}
    Result<Clustering> run();

private:
    void make_units();
    void merge_coincident();
    void accumulate_quadrics();
    void accumulate_boundaries(const std::vector<Pair>& sorted_uses);
    void connect_edges();
    void connect_lone_clusters();
    double contraction_error(Pair pair, glm::dvec4& place) const;
    double gap_error(Pair pair) const;
    void choose_partners();
    std::vector<Index> ordered_choices() const;
    void contract(Pair pair);
    void contract_round();
    void close_gaps(std::span<const Index> joined_with);
    glm::dvec4 lift(Index vertex) const {
        return {(input_.mesh.positions[vertex] - centre_) * scale_, input_.luminance[vertex] * luminance_scale};
    }

    const ClusterInput& input_;
    Progress progress_;
    Clustering result_;
    glm::dvec3 centre_{0};
    double scale_ = 1;      // mesh units to the unit box
    double area_scale_ = 1; // areas to shares of the largest

    // By live cluster slot.
    std::vector<Index> cluster_;       // its number in the result
    std::vector<Quadric> quadrics_;
    std::vector<glm::dvec4> places_;   // position and luminance of its proxy
    std::vector<Index> best_;          // index of its best pair
    std::vector<Pair> pairs_;          // the edges, sorted and unique; then this round's pairs across gaps
    std::size_t edge_count_ = 0;
    std::vector<double> errors_;       // by pair
    std::vector<Index> slot_of_vertex_;
};

void QuadricClusterer::make_units() {
    glm::dvec3 low = input_.mesh.positions[0], high = low;
    for (const glm::dvec3& p : input_.mesh.positions) {
        low = glm::min(low, p);
        high = glm::max(high, p);
    }
    const glm::dvec3 size = high - low;
    const double extent = std::max({size.x, size.y, size.z});
    centre_ = (low + high) * 0.5;
    scale_ = extent > 0 ? 1 / extent : 1;
    double largest = 0;
    for (const double a : input_.areas) largest = std::max(largest, a);
    area_scale_ = largest > 0 ? 1 / largest : 1;
}

// Coincident vertices are joined first, whatever their attributes: above them, everything moves together, without cracks.
void QuadricClusterer::merge_coincident() {
    const Index n = static_cast<Index>(input_.mesh.positions.size());
    result_.parents.resize(n);
    std::iota(result_.parents.begin(), result_.parents.end(), Index{0});
    std::vector<Index> members(n, 0);
    for (Index v = 0; v < n; ++v) ++members[input_.coincident[v]];
    slot_of_vertex_.resize(n);
    for (Index v = 0; v < n; ++v) {
        if (input_.coincident[v] != v) {
            const Index slot = slot_of_vertex_[v] = slot_of_vertex_[input_.coincident[v]];
            result_.parents[v] = cluster_[slot];
            continue;
        }
        Index cluster = v;
        if (members[v] > 1) {
            cluster = static_cast<Index>(result_.parents.size());
            result_.parents.push_back(cluster);
            result_.positions.push_back(input_.mesh.positions[v]);
            result_.parents[v] = cluster;
        }
        slot_of_vertex_[v] = static_cast<Index>(cluster_.size());
        cluster_.push_back(cluster);
    }
    quadrics_.resize(cluster_.size());
    places_.assign(cluster_.size(), glm::dvec4(0));
    for (Index v = 0; v < n; ++v) places_[slot_of_vertex_[v]] += lift(v) / static_cast<double>(members[input_.coincident[v]]);
}

void QuadricClusterer::accumulate_quadrics() {
    for (const Triangle& t : input_.mesh.triangles) {
        const glm::dvec4 p = lift(t[0]);
        glm::dvec4 e = lift(t[1]) - p, f = lift(t[2]) - p;
        const double area =
            glm::length(glm::cross(glm::dvec3(e), glm::dvec3(f))) / (2 * scale_ * scale_) * area_scale_ / 3;
        const double e_length = glm::length(e);
        if (!(e_length > 0)) continue;
        e /= e_length;
        f -= glm::dot(e, f) * e;
        const double f_length = glm::length(f);
        if (!(f_length > 0)) continue;
        f /= f_length;
        for (const Index v : t) {
            Quadric& q = quadrics_[slot_of_vertex_[v]];
            add_plane(q, p, e, f, area);
            q.weight += area;
        }
    }
    // Areas may be tiny or zero; every vertex keeps a little weight of its own, so that the form has a minimum.
    constexpr double least_weight = 1e-6; // share of the largest vertex area
    for (Index v = 0; v < input_.mesh.positions.size(); ++v) {
        const double w = input_.areas[v] * area_scale_ + least_weight;
        add_point(quadrics_[slot_of_vertex_[v]], lift(v), w * compactness, w * luminance_compactness);
    }
}

// An edge with one triangle holds the contour: a hyperplane through it, at a right angle to the triangle.
void QuadricClusterer::accumulate_boundaries(const std::vector<Pair>& sorted_uses) {
    const auto uses = [&](Pair pair) {
        const auto range = std::equal_range(sorted_uses.begin(), sorted_uses.end(), pair);
        return range.second - range.first;
    };
    for (const Triangle& t : input_.mesh.triangles) {
        for (std::size_t k = 0; k < 3; ++k) {
            const Index v = t[k], w = t[(k + 1) % 3];
            const Index a = slot_of_vertex_[v], b = slot_of_vertex_[w];
            if (a == b || uses({std::min(a, b), std::max(a, b)}) != 1) continue;
            const glm::dvec3 p(lift(v)), edge = glm::dvec3(lift(w)) - p, side = glm::dvec3(lift(t[(k + 2) % 3])) - p;
            const double squared = glm::dot(edge, edge);
            const glm::dvec3 normal = side - edge * (glm::dot(side, edge) / squared);
            const double length = glm::length(normal);
            if (!(length > 0) || !(squared > 0)) continue;
            const glm::dvec3 n = normal / length;
            const double weight = boundary_weight * squared / (scale_ * scale_) * area_scale_;
            for (const Index slot : {a, b}) add_hyperplane(quadrics_[slot], glm::dvec4(n, 0), glm::dot(n, p), weight);
        }
    }
}

void QuadricClusterer::connect_edges() {
    pairs_.reserve(input_.mesh.triangles.size() * 3);
    for (const Triangle& t : input_.mesh.triangles) {
        for (std::size_t k = 0; k < 3; ++k) {
            const Index a = slot_of_vertex_[t[k]], b = slot_of_vertex_[t[(k + 1) % 3]];
            if (a != b) pairs_.push_back({std::min(a, b), std::max(a, b)});
        }
    }
    tbb::parallel_sort(pairs_.begin(), pairs_.end());
    accumulate_boundaries(pairs_);
    pairs_.erase(std::unique(pairs_.begin(), pairs_.end()), pairs_.end());
    edge_count_ = pairs_.size();
}

// Interleaves the lowest 21 bits of three coordinates in 0..1.
std::uint64_t morton(glm::dvec3 p) {
    const auto spread = [](double x) {
        auto bits = static_cast<std::uint64_t>(std::clamp(x, 0.0, 1.0) * 2097151.0);
        bits = (bits | bits << 32) & 0x1f00000000ffffull;
        bits = (bits | bits << 16) & 0x1f0000ff0000ffull;
        bits = (bits | bits << 8) & 0x100f00f00f00f00full;
        bits = (bits | bits << 4) & 0x10c30c30c30c30c3ull;
        return (bits | bits << 2) & 0x1249249249249249ull;
    };
    return spread(p.x) | spread(p.y) << 1 | spread(p.z) << 2;
}

// Clusters that no edge reaches get pairs with their neighbours along a Morton curve.
void QuadricClusterer::connect_lone_clusters() {
    constexpr std::size_t neighbours = 3; // each way along the curve
    pairs_.resize(edge_count_);
    std::vector<std::uint8_t> reached(cluster_.size(), 0);
    for (const Pair& p : pairs_) reached[p.a] = reached[p.b] = 1;
    if (std::find(reached.begin(), reached.end(), 0) == reached.end()) return;
    std::vector<std::pair<std::uint64_t, Index>> curve(cluster_.size());
    for (Index s = 0; s < cluster_.size(); ++s) curve[s] = {morton(glm::dvec3(places_[s]) + 0.5), s};
    std::sort(curve.begin(), curve.end());
    for (std::size_t i = 0; i < curve.size(); ++i) {
        for (std::size_t j = i + 1; j < std::min(curve.size(), i + 1 + neighbours); ++j) {
            const Index a = curve[i].second, b = curve[j].second;
            if (!reached[a] || !reached[b]) pairs_.push_back({std::min(a, b), std::max(a, b)});
        }
    }
}

double QuadricClusterer::contraction_error(Pair pair, glm::dvec4& place) const {
    Quadric q = quadrics_[pair.a];
    q += quadrics_[pair.b];
    const glm::dvec4 a = places_[pair.a], b = places_[pair.b];
    const glm::dvec4 middle = (a + b) * 0.5;
    // Where the form is nearly flat its minimum may be far away; then the middle is the better place.
    if (!minimise(q, place) || !(glm::length(glm::dvec3(place - middle)) <= glm::length(glm::dvec3(a - b)) * 1.0))
        place = middle;
    return q.error(place);
}

// Ward's measure: by how much the sum of squared distances from the clusters' middles grows.
double QuadricClusterer::gap_error(Pair pair) const {
    const double a = quadrics_[pair.a].weight, b = quadrics_[pair.b].weight;
    if (!(a + b > 0)) return 0;
    const glm::dvec3 d(places_[pair.a] - places_[pair.b]);
    return gap_weight * (a * b / (a + b)) * glm::dot(d, d);
}

void QuadricClusterer::choose_partners() {
    errors_.resize(pairs_.size());
    tbb::parallel_for(std::size_t{0}, pairs_.size(), [&](std::size_t i) {
        glm::dvec4 place;
        errors_[i] = contraction_error(pairs_[i], place) + (i < edge_count_ ? 0 : gap_error(pairs_[i]));
    });
    best_.assign(cluster_.size(), no_node);
    for (Index i = 0; i < pairs_.size(); ++i)
        for (const Index slot : {pairs_[i].a, pairs_[i].b})
            if (best_[slot] == no_node || errors_[i] < errors_[best_[slot]]) best_[slot] = i;
}

// The pairs that are the best of one of their clusters, in ascending error.
std::vector<Index> QuadricClusterer::ordered_choices() const {
    std::vector<Index> order(best_);
    std::sort(order.begin(), order.end(),
              [&](Index x, Index y) { return errors_[x] != errors_[y] ? errors_[x] < errors_[y] : x < y; });
    order.erase(std::unique(order.begin(), order.end()), order.end());
    return order;
}

// Joins b to a: a's slot holds the new cluster.
void QuadricClusterer::contract(Pair pair) {
    glm::dvec4 place;
    contraction_error(pair, place);
    const Index parent = static_cast<Index>(result_.parents.size());
    result_.parents.push_back(parent);
    result_.positions.push_back(glm::dvec3(place) / scale_ + centre_);
    result_.parents[cluster_[pair.a]] = result_.parents[cluster_[pair.b]] = parent;
    cluster_[pair.a] = parent;
    quadrics_[pair.a] += quadrics_[pair.b];
    places_[pair.a] = place;
}

// Contracts pairs that are the best of both their clusters, in ascending error.
void QuadricClusterer::contract_round() {
    choose_partners();
    const std::vector<Index> order = ordered_choices();
    std::vector<Index> joined_with(cluster_.size());
    std::iota(joined_with.begin(), joined_with.end(), Index{0});
    std::vector<std::uint8_t> taken(cluster_.size(), 0);
    std::size_t contracted = 0;
    const auto contract_all = [&](bool second_best) {
        for (const Index i : order) {
            const Pair p = pairs_[i];
            const bool mutual = errors_[i] <= errors_[best_[p.a]] && errors_[i] <= errors_[best_[p.b]];
            if (taken[p.a] || taken[p.b] || !(mutual || second_best)) continue;
            taken[p.a] = taken[p.b] = 1;
            contract(p);
            joined_with[p.b] = p.a;
            ++contracted;
        }
    };
    contract_all(false);
    if (contracted < cluster_.size() / least_round_share) contract_all(true);
    close_gaps(joined_with);
}

// Renumbers the slots without those that were joined to others, and the edges with them.
void QuadricClusterer::close_gaps(std::span<const Index> joined_with) {
    std::vector<Index> new_slot(cluster_.size());
    Index live = 0;
    for (Index s = 0; s < cluster_.size(); ++s) {
        if (joined_with[s] != s) continue;
        new_slot[s] = live;
        cluster_[live] = cluster_[s];
        quadrics_[live] = quadrics_[s];
        places_[live] = places_[s];
        ++live;
    }
    cluster_.resize(live);
    quadrics_.resize(live);
    places_.resize(live);
    std::size_t kept = 0;
    for (std::size_t i = 0; i < edge_count_; ++i) {
        const Index a = new_slot[joined_with[pairs_[i].a]], b = new_slot[joined_with[pairs_[i].b]];
        if (a != b) pairs_[kept++] = {std::min(a, b), std::max(a, b)};
    }
    pairs_.resize(kept);
    tbb::parallel_sort(pairs_.begin(), pairs_.end());
    pairs_.erase(std::unique(pairs_.begin(), pairs_.end()), pairs_.end());
    edge_count_ = pairs_.size();
}

Result<Clustering> QuadricClusterer::run() {
    make_units();
    merge_coincident();
    accumulate_quadrics();
    connect_edges();
    const double total = static_cast<double>(cluster_.size());
    while (cluster_.size() > 1) {
        if (progress_ && !progress_(1 - static_cast<double>(cluster_.size()) / total, "clustering"))
            return Error{ErrorCode::cancelled, "Clustering was cancelled."};
        connect_lone_clusters();
        contract_round();
    }
    return std::move(result_);
}

} // namespace

Result<Clustering> cluster_quadric(const ClusterInput& input, const Progress& progress) {
    return QuadricClusterer(input, progress).run();
}

} // namespace unseen::vdtree
