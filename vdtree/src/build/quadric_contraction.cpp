#include "build/quadric_contraction.h"

#include <bit>
#include <limits>
#include <numeric>

#include <glm/geometric.hpp>

#include "build/quadric.h"
#include "build/spatial_order.h"

// Vectors wider than the target's are only handed to functions that are inlined.
#pragma GCC diagnostic ignored "-Wpsabi"

namespace unseen::vdtree {

namespace {

// Weight of the squared distance between a cluster's vertices and its proxy, against that from the planes. Keeps
// clusters compact where the planes do not care. With 0.01 bunny and dragon stray 7 to 11% farther for their triangles;
// with 0.001 hardly less far than with this, but clusters grow long in flat areas.
constexpr float compactness = 0.003f;
// Weight of a channel's variance within a cluster, against the deviation from the interpolated value.
constexpr float channel_compactness = 0.1f;
// Weight of the planes that stand on boundary edges, against those of triangles.
constexpr double boundary_weight = 4;
// Across a gap that no edge bridges, the full squared distance counts: joining two parts moves both.
constexpr float gap_weight = 1;
// Areas may be tiny or zero; every vertex keeps a little weight of its own, so that the form has a minimum.
constexpr double least_weight = 1e-6; // share of the largest vertex area
// A round that contracts a smaller share of the clusters takes other than mutually best pairs too: errors that grow
// along a chain would otherwise contract one pair a round.
constexpr std::size_t least_round_share = 16; // one in so many
// Clusters that no edge reaches are paired with this many neighbours each way along a Morton curve.
constexpr std::size_t curve_neighbours = 3;

// Rounds in which a component that is released becomes a single vertex and is taken up by a neighbour.
constexpr std::size_t rounds_to_absorb = 4;

constexpr Index none = std::numeric_limits<Index>::max();

// ---- quadrics of several clusters side by side

// The first `floats` numbers of as many clusters' quadrics as F has lanes, one cluster a lane.
template <class F, std::size_t lanes>
UNSEEN_INLINE void gather(const float* quadrics, const Index (&clusters)[lanes], std::size_t floats, F* out) {
    const std::size_t stride = floats;
    for (std::size_t i = 0; i < floats; i += 4) {
        load_columns([&](std::size_t lane) UNSEEN_INLINE_LAMBDA { return quadrics + clusters[lane] * stride + i; },
                     out + i);
    }
}

// ---- a part's first clusters

class PartSetup {
public:
    explicit PartSetup(const PartMesh& part)
        : part_(part), own_(part.own_slots), channels_(part.channels), stride_(quadric_stride(channels_)) {
        result_.first_slot = part.first_slot;
        result_.end_slot = part.first_slot + own_;
        result_.channels = channels_;
    }

    Contraction run() {
        make_clusters();
        for (const Triangle& t : part_.triangles) add_triangle(t);
        add_vertices();
        find_edges();
        return std::move(result_);
    }

private:
    float* quadric_of(Index slot) { return result_.live.quadrics.data() + slot * stride_; }
    Index slot(Index vertex) const { return part_.slot_of_vertex[vertex]; }
    const float* values(Index vertex) const { return part_.channel_values.data() + vertex * channels_; }
    glm::dvec3 corner(Index vertex) const { return part_.positions[slot(vertex)]; }

    void make_clusters() {
        LiveClusters& live = result_.live;
        for (Index s = 0; s < own_; ++s) live.clusters.push_back({part_.first_slot + s, 0});
        live.places.assign(part_.positions.begin(), part_.positions.begin() + own_);
        live.quadrics.assign(own_ * stride_, 0);
        live.references.assign(own_ * channels_, 0);
        for (Index v = 0; v < part_.slot_of_vertex.size() && slot(v) < own_;) {
            Index end = v;
            float* reference = live.references.data() + slot(v) * channels_;
            for (; end < part_.slot_of_vertex.size() && slot(end) == slot(v); ++end)
                for (std::size_t c = 0; c < channels_; ++c) reference[c] += values(end)[c];
            for (std::size_t c = 0; c < channels_; ++c) reference[c] /= static_cast<float>(end - v);
            v = end;
        }
        own_vertices_ =
            static_cast<Index>(std::lower_bound(part_.slot_of_vertex.begin(), part_.slot_of_vertex.end(), own_) -
                               part_.slot_of_vertex.begin());
        vertex_weights_.assign(own_vertices_, static_cast<float>(least_weight));
    }

    static void add_plane(float* q, float strength, glm::vec3 n) {
        using namespace quadric;
        q[xx] += strength * n.x * n.x, q[xy] += strength * n.x * n.y, q[xz] += strength * n.x * n.z;
        q[yy] += strength * n.y * n.y, q[yz] += strength * n.y * n.z, q[zz] += strength * n.z * n.z;
    }

    // The plane, and each channel's linear function on it, seen from each own corner.
    void add_triangle(const Triangle& t) {
        using namespace quadric;
        const glm::dvec3 p = corner(t[0]), e = corner(t[1]) - p, f = corner(t[2]) - p;
        const glm::dvec3 cross = glm::cross(e, f);
        const double squared = glm::dot(cross, cross);
        if (!(squared > 0)) return;
        const double length = std::sqrt(squared);
        const glm::vec3 n(cross / length);
        const float area = static_cast<float>(length * part_.area_scale / 6); // a third of the triangle's
        const glm::dvec3 by_e = glm::cross(f, cross) / squared, by_f = glm::cross(cross, e) / squared;
        glm::vec3 gradients[most_channels];
        float weights[most_channels];
        for (std::size_t c = 0; c < channels_; ++c) {
            const double base = values(t[0])[c];
            const glm::vec3 g((values(t[1])[c] - base) * by_e + (values(t[2])[c] - base) * by_f);
            const float g_squared = glm::dot(g, g);
            const bool bounded = g_squared < std::numeric_limits<float>::max();
            gradients[c] = bounded ? g : glm::vec3(0);
            weights[c] = bounded ? area / (1 + g_squared) : 0;
        }
        for (const Index v : t) {
            const Index s = slot(v);
            if (s >= own_) continue;
            vertex_weights_[v] += area;
            float* q = quadric_of(s);
            add_plane(q, area, n);
            for (std::size_t c = 0; c < channels_; ++c) {
                const glm::vec3 g = gradients[c];
                const float cw = weights[c], wd = cw * (values(v)[c] - result_.live.references[s * channels_ + c]);
                add_plane(q, cw, g);
                q[hx] += wd * g.x, q[hy] += wd * g.y, q[hz] += wd * g.z;
                float* channel = q + first_channel + c * channel_size;
                channel[gx] += cw * g.x, channel[gy] += cw * g.y, channel[gz] += cw * g.z;
                channel[d] += wd;
                channel[quadric::w] += cw;
            }
        }
    }

    void add_vertices() {
        using namespace quadric;
        for (Index v = 0; v < own_vertices_; ++v) {
            const Index s = slot(v);
            float* q = quadric_of(s);
            const float point = vertex_weights_[v];
            q[weight] += point;
            q[xx] += point * compactness, q[yy] += point * compactness, q[zz] += point * compactness;
            for (std::size_t c = 0; c < channels_; ++c) {
                float* channel = q + first_channel + c * channel_size;
                channel[d] += point * channel_compactness * (values(v)[c] - result_.live.references[s * channels_ + c]);
                channel[quadric::w] += point * channel_compactness;
            }
        }
        // Where vertices with different values coincide, that difference is there before any contraction and costs
        // nothing.
        for (Index s = 0; s < own_; ++s) {
            float* q = quadric_of(s);
            for (std::size_t c = 0; c < channels_; ++c) {
                const float* channel = q + first_channel + c * channel_size;
                q[k] += channel[d] * channel[d] / channel[quadric::w];
            }
        }
    }

    // One side of a triangle; lower and higher local slot.
    struct Use {
        Index high;
        Index side; // triangle * 3 + its first corner
    };

    // From a lower slot, with its sides of triangles.
    struct Edge {
        Index high, side, second_side = none, uses = 1;
    };

    // Every edge with an own end: within the part a pair, to a ghost an outer edge. An edge with one triangle holds the
    // contour.
    void find_edges() {
        std::vector<Index> start(own_ + 1, 0);
        const auto for_each_side = [&](auto&& f) {
            for (Index t = 0; t < part_.triangles.size(); ++t) {
                const Triangle& tri = part_.triangles[t];
                for (Index c = 0; c < 3; ++c) {
                    const Index a = slot(tri[c]), b = slot(tri[c == 2 ? 0 : c + 1]);
                    if (a != b && std::min(a, b) < own_) f(std::min(a, b), std::max(a, b), t * 3 + c);
                }
            }
        };
        for_each_side([&](Index low, Index, Index) { ++start[low + 1]; });
        std::partial_sum(start.begin(), start.end(), start.begin());
        std::vector<Use> uses(start.back());
        for_each_side([&](Index low, Index high, Index side) { uses[start[low]++] = {high, side}; });
        // Filling has moved each start to its end.
        std::vector<Index> seen_from(part_.positions.size(), none), entry(part_.positions.size());
        result_.pairs.reserve(uses.size() / 2 + uses.size() / 16);
        std::vector<Edge> edges;
        for (Index low = 0; low < own_; ++low) {
            edges.clear();
            for (Index i = low == 0 ? 0 : start[low - 1]; i < start[low]; ++i) {
                const Use& use = uses[i];
                if (seen_from[use.high] != low) {
                    seen_from[use.high] = low;
                    entry[use.high] = static_cast<Index>(edges.size());
                    edges.push_back({use.high, use.side});
                } else if (Edge& edge = edges[entry[use.high]]; ++edge.uses == 2) {
                    edge.second_side = use.side;
                }
            }
            for (const Edge& edge : edges) {
                if (edge.uses == 1) add_boundary(low, edge.high, edge.side, boundary_weight);
                if (edge.uses == 2) hold_seam(low, edge);
                if (edge.high < own_) {
                    result_.pairs.push_back({low, edge.high});
                } else {
                    result_.outer_edges.push_back({low, part_.ghost_slots[edge.high - own_]});
                    if (result_.border_slots.empty() || result_.border_slots.back().cluster != low)
                        result_.border_slots.push_back({part_.first_slot + low, low});
                }
            }
        }
    }

    // A plane through the edge, at a right angle to its triangle.
    void add_boundary(Index low, Index high, Index side, double edge_weight) {
        const Triangle& t = part_.triangles[side / 3];
        const glm::dvec3 p = corner(t[side % 3]), edge = corner(t[(side + 1) % 3]) - p,
                         inner = corner(t[(side + 2) % 3]) - p;
        const double squared = glm::dot(edge, edge);
        const glm::dvec3 normal = inner - edge * (glm::dot(inner, edge) / squared);
        const double length = glm::length(normal);
        if (!(length > 0) || !(squared > 0)) return;
        const glm::vec3 n(normal / length);
        const float strength = static_cast<float>(edge_weight * squared * part_.area_scale);
        for (const Index s : {low, high})
            if (s < own_) add_plane(quadric_of(s), strength, n);
    }

    // Two triangles that meet at an edge with different vertices: where the values differ, the seam is a contour too.
    void hold_seam(Index low, const Edge& edge) {
        if (own_vertices_ == own_ && part_.slot_of_vertex.size() == part_.positions.size()) return; // nothing coincides
        const Triangle &t = part_.triangles[edge.side / 3], &u = part_.triangles[edge.second_side / 3];
        const Index t0 = t[edge.side % 3], t1 = t[(edge.side + 1) % 3];
        Index u0 = u[edge.second_side % 3], u1 = u[(edge.second_side + 1) % 3];
        if (slot(u0) != slot(t0)) std::swap(u0, u1);
        if (t0 == u0 && t1 == u1) return;
        float difference = 0; // unit-box length squared
        for (std::size_t c = 0; c < channels_; ++c) {
            const float at0 = values(t0)[c] - values(u0)[c], at1 = values(t1)[c] - values(u1)[c];
            difference = std::max({difference, at0 * at0, at1 * at1});
        }
        // A step in the values as large as `whole_step` is held like a boundary, a smaller one less.
        constexpr float whole_step = 0.002f; // unit-box length
        const double share = std::min(1.0f, difference / (whole_step * whole_step));
        if (!(share > 0)) return;
        for (const Index side : {edge.side, edge.second_side})
            add_boundary(low, edge.high, side, boundary_weight * share);
    }

    const PartMesh& part_;
    Index own_, own_vertices_ = 0;
    std::size_t channels_, stride_;
    std::vector<float> vertex_weights_; // by own vertex
    Contraction result_;
};

// ---- rounds of contraction

class Contractor {
public:
    explicit Contractor(Contraction& c)
        : c_(c), live_(c.live), merges_(c.record.merges), channels_(c.channels), stride_(quadric_stride(c.channels)) {}

    void run(Index target, const RoundCallback& after_round) {
        const std::size_t wanted = std::max<Index>(target, 1);
        if (live_.size() <= wanted) return;
        merges_.reserve(live_.size() - wanted);
        find_components();
        for (std::size_t round = 0; live_.size() > wanted; ++round) {
            const std::size_t before = merges_.size(), clusters = live_.size();
            if (impatient_ || round % rounds_to_absorb == 1) release_components();
            contract_round();
            const std::size_t made = merges_.size() - before;
            // Clusters that wait for edges out of the range must not hold up the rest.
            impatient_ = made < clusters / least_round_share + 1;
            if (made == 0) continue;
            c_.record.round_ends.push_back(static_cast<Index>(merges_.size()));
            close_gaps();
            if (!after_round(made)) return;
        }
        const auto key = [](const Contraction::OuterEdge& edge) { return std::pair(edge.cluster, edge.far_slot); };
        std::ranges::sort(c_.outer_edges, {}, key);
        std::vector<Contraction::OuterEdge>& edges = c_.outer_edges;
        const auto is_repeated = [&](const auto& a, const auto& b) { return key(a) == key(b); };
        edges.erase(std::unique(edges.begin(), edges.end(), is_repeated), edges.end());
    }

private:
    float* quadric_of(Index cluster) { return live_.quadrics.data() + cluster * stride_; }
    const float* quadric_of(Index cluster) const { return live_.quadrics.data() + cluster * stride_; }
    glm::vec3 offset(ClusterPair p) const { return glm::vec3(live_.places[p.b] - live_.places[p.a]); }

    // ---- components

    // What edges connect, as far as the range goes. A closed component that is down to three clusters, a last triangle,
    // is held: they are not contracted until the component is released. Then it vanishes, and its one vertex that is
    // left becomes part of what stays near it, which so grows to cover both.
    struct Component {
        Index parent; // itself, or the one that it was joined to across a gap
        Index clusters = 0;
        bool open = false; // has edges out of the range
        bool released = false;
        float gap = 0;        // how far it strays when it vanishes
        glm::dvec3 middle{0}; // while some are to be released
    };

    Index component_of(Index cluster) {
        Index c = component_[cluster];
        while (components_[c].parent != c) c = components_[c].parent = components_[components_[c].parent].parent;
        return component_[cluster] = c;
    }
    static bool is_held(const Component& c) { return c.clusters == 3 && !c.open && !c.released; }
    static bool is_vertex(const Component& c) { return c.clusters == 1 && !c.open; }
    bool is_held(Index cluster) { return is_held(components_[component_of(cluster)]); }

    void find_components() {
        const Index count = static_cast<Index>(live_.size());
        component_.resize(count);
        std::iota(component_.begin(), component_.end(), Index{0});
        components_.resize(count);
        for (Index i = 0; i < count; ++i) components_[i] = {.parent = i, .clusters = 1};
        for (const ClusterPair& p : c_.pairs) unite(component_of(p.a), component_of(p.b));
        for (const auto& edge : c_.outer_edges) components_[component_of(edge.cluster)].open = true;
    }

    Index unite(Index x, Index y) {
        if (x == y) return x;
        if (components_[x].clusters < components_[y].clusters) std::swap(x, y);
        Component &to = components_[x], &from = components_[y];
        from.parent = x;
        to.clusters += from.clusters;
        to.open |= from.open;
        return x;
    }

    // Releases one of two held components that are each other's nearest, and each that is near something larger.
    void release_components() {
        const Index count = static_cast<Index>(live_.size());
        bool any = false;
        for (Index s = 0; s < count && !any; ++s) any = is_held(s);
        if (!any) return;
        order_along_curve();
        for (Component& c : components_) c.middle = glm::dvec3(0);
        for (Index s = 0; s < count; ++s) {
            Component& c = components_[component_of(s)];
            c.middle += live_.places[s] / static_cast<double>(c.clusters);
        }
        nearest_.assign(components_.size(), {none, std::numeric_limits<float>::infinity()});
        const auto propose = [&](Index from, Index to, float distance) {
            const Component& partner = components_[to];
            if (!is_held(components_[from]) || (partner.clusters < 3 && !partner.open) || partner.released) return;
            // Ties go to the lower pair of numbers, for both.
            Nearest& best = nearest_[from];
            const auto key = [&](Index other) { return std::pair(std::min(from, other), std::max(from, other)); };
            if (distance < best.distance ||
                (distance == best.distance && best.component != none && key(to) < key(best.component)))
                best = {to, distance};
        };
        for (std::size_t i = 0; i < curve_.size(); ++i) {
            const Index a = component_of(curve_[i].index);
            std::size_t found = 0;
            for (std::size_t j = i + 1; j < curve_.size() && found < curve_neighbours; ++j) {
                const Index b = component_of(curve_[j].index);
                if (a == b) {
                    if (!is_held(components_[a])) break; // inside a larger one
                    continue;
                }
                ++found;
                const auto middle = [&](std::size_t k, Index c) {
                    return is_held(components_[c]) ? components_[c].middle : live_.places[curve_[k].index];
                };
                const float distance = static_cast<float>(glm::distance(middle(i, a), middle(j, b)));
                propose(a, b, distance);
                propose(b, a, distance);
            }
        }
        bool released = false;
        const auto release = [&](Index c, float gap) {
            components_[c].released = released = true;
            components_[c].gap = gap;
        };
        for (Index s = 0; s < count; ++s) {
            const Index c = component_of(s), partner = nearest_[c].component;
            if (!is_held(components_[c]) || partner == none) continue;
            if (!is_held(components_[partner])) {
                if (!components_[partner].released) release(c, nearest_[c].distance);
            } else if (nearest_[partner].component == c) {
                release(std::max(c, partner), nearest_[c].distance);
            }
        }
        if (released || !impatient_) return;
        // Nothing is near enough, or nothing else is left.
        for (Index s = 0; s < count; ++s)
            if (is_held(s)) return release(component_of(s), live_[s].deviation);
    }

    // Whether a contraction now leaves a triangle where one is to stay.
    bool is_allowed(ClusterPair p) {
        const Component &a = components_[component_of(p.a)], &b = components_[component_of(p.b)];
        if (&a == &b) return !is_held(a);
        return (!is_held(a) || is_vertex(b)) && (!is_held(b) || is_vertex(a));
    }

    void note_components(ClusterPair p) {
        const Index a = component_of(p.a), b = component_of(p.b);
        if (a == b && components_[a].released && components_[a].clusters == 3)
            c_.record.vanishings.push_back({live_[p.b].name, components_[a].gap});
        --components_[unite(a, b)].clusters;
    }

    // ---- errors

    // A pair and its error, in ascending error, then in the order of the pairs. Errors are not negative, so that floats
    // compare like their bits.
    class Rank {
    public:
        Rank() = default; // no pair: above all
        Rank(float error, Index pair) : bits_(std::uint64_t{std::bit_cast<std::uint32_t>(error)} << 32 | pair) {}

        bool is_none() const { return bits_ == no_bits; }
        Index pair() const { return static_cast<Index>(bits_); }
        float error() const { return std::bit_cast<float>(static_cast<std::uint32_t>(bits_ >> 32)); }
        auto operator<=>(const Rank&) const = default;

    private:
        static constexpr std::uint64_t no_bits = ~std::uint64_t{0};
        std::uint64_t bits_ = no_bits;
    };
    static constexpr float unknown_error = -1;

    // Errors of as many pairs as F has lanes. `channels` is channels_, as a constant where the compiler is to unroll.
    template <class F>
    UNSEEN_INLINE void errors_of(const ClusterPair* pairs, std::size_t channels, float* errors) const {
        constexpr std::size_t lanes = sizeof(F) / sizeof(float);
        Index a[lanes], b[lanes];
        float offsets[3][lanes], differences[most_channels][lanes];
        for (std::size_t l = 0; l < lanes; ++l) {
            a[l] = pairs[l].a;
            b[l] = pairs[l].b;
            const glm::vec3 d = offset(pairs[l]);
            for (int axis = 0; axis < 3; ++axis) offsets[axis][l] = d[axis];
            for (std::size_t c = 0; c < channels; ++c)
                differences[c][l] = live_.references[b[l] * channels + c] - live_.references[a[l] * channels + c];
        }
        F qa[most_quadric_floats], qb[most_quadric_floats], sum[most_quadric_floats], d[3], difference[most_channels];
        std::memcpy(d, offsets, sizeof(d));
        std::memcpy(difference, differences, channels * sizeof(F));
        const float* quadrics = live_.quadrics.data();
        gather(quadrics, a, quadric_stride(channels), qa);
        gather(quadrics, b, quadric_stride(channels), qb);
        add_from(qa, qb, d[0], d[1], d[2], difference, channels, sum);
        const F found = minimise(sum, d[0], d[1], d[2], channels).error;
        std::memcpy(errors, &found, sizeof(F));
    }
    template <class F>
    UNSEEN_INLINE void errors_of_all(std::span<const ClusterPair> pairs, float* errors) const {
        constexpr std::size_t lanes = sizeof(F) / sizeof(float);
        for (std::size_t i = 0; i < pairs.size(); i += lanes) {
            ClusterPair some[lanes];
            float found[lanes];
            const std::size_t count = std::min(lanes, pairs.size() - i);
            for (std::size_t l = 0; l < lanes; ++l) some[l] = pairs[i + std::min(l, count - 1)];
            if (channels_ == 1) errors_of<F>(some, 1, found);
            else errors_of<F>(some, channels_, found);
            std::copy_n(found, count, errors + i);
        }
    }
    UNSEEN_AVX2 void errors_by_eights(std::span<const ClusterPair> pairs, float* errors) const {
        errors_of_all<Float8>(pairs, errors);
    }
    // Neither has fused operations, so both give the same bits.
    void find_errors(std::span<const ClusterPair> pairs, float* errors) const {
        if (has_avx2()) errors_by_eights(pairs, errors);
        else errors_of_all<Float4>(pairs, errors);
    }

    // Ward's measure: by how much the sum of squared distances from the clusters' middles grows.
    float gap_error(ClusterPair p) const {
        const float a = quadric_of(p.a)[quadric::weight], b = quadric_of(p.b)[quadric::weight];
        const glm::vec3 d = offset(p);
        return gap_weight * (a * b / (a + b)) * glm::dot(d, d);
    }

    // Keeps the errors of pairs whose clusters have not changed since the last round.
    void update_errors(std::size_t first) {
        pair_errors_.resize(c_.pairs.size(), unknown_error);
        unknown_.clear();
        unknown_pairs_.clear();
        for (std::size_t i = first; i < c_.pairs.size(); ++i) {
            if (pair_errors_[i] >= 0) continue;
            unknown_.push_back(static_cast<Index>(i));
            unknown_pairs_.push_back(c_.pairs[i]);
        }
        found_errors_.resize(unknown_.size());
        find_errors(unknown_pairs_, found_errors_.data());
        for (std::size_t i = 0; i < unknown_.size(); ++i) pair_errors_[unknown_[i]] = found_errors_[i];
    }

    // Lets the pairs from `first` on compete for being the best of their clusters; `gaps`: no edges join them. Ties go
    // to the pair that comes first, for both its clusters, so some pair is always the best of both.
    void compete(std::size_t first, bool gaps) {
        update_errors(first);
        for (std::size_t i = first; i < c_.pairs.size(); ++i) {
            const ClusterPair p = c_.pairs[i];
            if (gaps ? !is_allowed(p) : held_[p.a] != 0) continue; // an edge is within one component
            const Rank rank(pair_errors_[i] + (gaps ? gap_error(p) : 0), static_cast<Index>(i));
            best_[p.a] = std::min(best_[p.a], rank);
            best_[p.b] = std::min(best_[p.b], rank);
        }
    }

    // ---- pairs across gaps

    void order_along_curve() {
        const MortonGrid grid(box_around(live_.places));
        curve_.resize(live_.size());
        curve_scratch_.resize(live_.size());
        for (Index s = 0; s < live_.size(); ++s) curve_[s] = {grid.code(live_.places[s]), s};
        sort_by_code(curve_, curve_scratch_);
    }

    // Clusters that no edge reaches get pairs with their neighbours along a Morton curve. One with edges out of the
    // range rather waits for these.
    void connect_lone_clusters() {
        lone_.assign(live_.size(), 0);
        bool any = false;
        for (Index s = 0; s < live_.size(); ++s) any |= (lone_[s] = best_[s].is_none());
        if (!any) return;
        if (!impatient_)
            for (const auto& edge : c_.outer_edges) lone_[edge.cluster] = 0;
        if (std::find(lone_.begin(), lone_.end(), 1) == lone_.end()) return;
        order_along_curve();
        for (std::size_t i = 0; i < curve_.size(); ++i) {
            for (std::size_t j = i + 1; j < std::min(curve_.size(), i + 1 + curve_neighbours); ++j) {
                const Index a = curve_[i].index, b = curve_[j].index;
                if (lone_[a] || lone_[b]) c_.pairs.push_back({std::min(a, b), std::max(a, b)});
            }
        }
    }

    // ---- one round

    void contract_round() {
        const std::size_t clusters = live_.size();
        best_.assign(clusters, {});
        into_.resize(clusters);
        std::iota(into_.begin(), into_.end(), Index{0});
        taken_.assign(clusters, 0);
        held_.resize(clusters);
        for (Index s = 0; s < clusters; ++s) held_[s] = is_held(s);
        edges_ = c_.pairs.size();
        compete(0, false);
        connect_lone_clusters();
        compete(edges_, true);

        const std::size_t before = merges_.size();
        const auto too_few = [&] { return merges_.size() - before < clusters / least_round_share; };
        contract_mutually_best();
        if (too_few()) contract_second_best();
        if (too_few()) contract_rivals();
        c_.pairs.resize(edges_);
        pair_errors_.resize(edges_);
        order_by_error(before);
    }

    // The merges from `first` on, all of one round. (They were made in spatial order, which is kinder to the cache.)
    void order_by_error(std::size_t first) {
        const std::size_t count = merges_.size() - first;
        order_.resize(count);
        order_scratch_.resize(count);
        // Floats that are not negative compare like their bits.
        for (std::size_t i = 0; i < count; ++i)
            order_[i] = {std::bit_cast<std::uint32_t>(merges_[first + i].error), static_cast<Index>(first + i)};
        sort_by_code(order_, order_scratch_);
        std::vector<Merge> sorted;
        sorted.reserve(count);
        for (const CodedIndex& item : order_) sorted.push_back(merges_[item.index]);
        std::ranges::copy(sorted, merges_.begin() + static_cast<std::ptrdiff_t>(first));
    }

    void contract_mutually_best() {
        for (Index s = 0; s < best_.size(); ++s) {
            if (best_[s].is_none()) continue;
            const ClusterPair p = c_.pairs[best_[s].pair()];
            if (p.a == s && best_[p.b] == best_[s] && is_allowed(p))
                contract(p, best_[s].error(), best_[s].pair() >= edges_);
        }
    }

    // Pairs that are the best of one of their clusters, in ascending error.
    void contract_second_best() {
        std::vector<Rank> order;
        for (Index s = 0; s < best_.size(); ++s)
            if (!best_[s].is_none() && !taken_[s]) order.push_back(best_[s]);
        std::sort(order.begin(), order.end());
        for (const Rank& best : order) {
            const ClusterPair p = c_.pairs[best.pair()];
            if (!taken_[p.a] && !taken_[p.b] && is_allowed(p)) contract(p, best.error(), best.pair() >= edges_);
        }
    }

    // Clusters that want the same partner are contracted with each other: a hub would otherwise contract with one spoke
    // a round.
    void contract_rivals() {
        std::vector<Index> waiting(best_.size(), none); // by the partner that is wanted
        for (Index s = 0; s < best_.size(); ++s) {
            if (best_[s].is_none() || taken_[s]) continue;
            const ClusterPair p = c_.pairs[best_[s].pair()];
            Index& rival = waiting[p.a == s ? p.b : p.a];
            if (rival == none) {
                rival = s;
            } else if (is_allowed({rival, s})) {
                contract({rival, s}, std::max(best_[rival].error(), best_[s].error()), false);
                rival = none;
            }
        }
    }

    // Two clusters span no triangle, so a connected part's last triangles go with the merge before its last.
    void note_vanishing(ClusterPair p, bool gap) {
        LiveCluster &to = live_[p.a], &from = live_[p.b];
        Index &a = to.vanishing, b = from.vanishing;
        if (gap && is_held(p.a) != is_held(p.b)) {
            a = none; // it is known already when they vanish
        } else if (gap) {
            if (quadric_of(p.a)[quadric::weight] < quadric_of(p.b)[quadric::weight]) std::swap(a, b);
            if (b != no_merge) c_.record.vanishings.push_back({b, glm::length(offset(p))});
            if (a == no_merge) a = b;
        } else {
            const bool a_later = from.made_by == no_merge || (to.made_by != no_merge && to.deviation > from.deviation);
            a = a_later ? to.made_by : from.made_by;
        }
        to.made_by = from.name;
    }

    // Joins b to a: a's slot holds the new cluster.
    void contract(ClusterPair p, float error, bool gap) {
        note_vanishing(p, gap);
        note_components(p);
        taken_[p.a] = taken_[p.b] = 1;
        into_[p.b] = p.a;
        float sum[most_quadric_floats] = {}, difference[most_channels];
        float* references = live_.references.data() + p.a * channels_;
        for (std::size_t c = 0; c < channels_; ++c)
            difference[c] = live_.references[p.b * channels_ + c] - references[c];
        const glm::vec3 d = offset(p);
        add_from(quadric_of(p.a), quadric_of(p.b), d.x, d.y, d.z, difference, channels_, sum);
        const Minimum<float> best = minimise(sum, d.x, d.y, d.z, channels_);
        recentre(sum, best.x, best.y, best.z, references, channels_);
        std::copy_n(sum, stride_, quadric_of(p.a));
        live_.places[p.a] += glm::dvec3(best.x, best.y, best.z);
        const float deviation = std::sqrt(error / sum[quadric::weight]);
        LiveCluster& made = live_[p.a];
        made.deviation = std::max({deviation, made.deviation, live_[p.b].deviation});
        merges_.push_back({made.name, live_[p.b].name, error, made.deviation, live_.places[p.a]});
    }

    // Renumbers the clusters without those that were joined to others, and the edges with them.
    void close_gaps() {
        new_number_.resize(live_.size());
        Index kept = 0;
        for (Index s = 0; s < live_.size(); ++s) {
            if (into_[s] != s) continue;
            new_number_[s] = kept | (taken_[s] ? is_new : 0);
            if (kept != s) {
                live_[kept] = live_[s];
                live_.places[kept] = live_.places[s];
                component_[kept] = component_[s];
                std::copy_n(quadric_of(s), stride_, quadric_of(kept));
                std::copy_n(live_.references.data() + s * channels_, channels_,
                            live_.references.data() + kept * channels_);
            }
            ++kept;
        }
        for (Index s = 0; s < live_.size(); ++s) // `into_` of a cluster that was joined is one that was not
            if (into_[s] != s) new_number_[s] = new_number_[into_[s]];
        live_.clusters.resize(kept);
        live_.places.resize(kept);
        component_.resize(kept);
        live_.quadrics.resize(kept * stride_);
        live_.references.resize(kept * channels_);
        for (auto& edge : c_.outer_edges) edge.cluster = new_number_[edge.cluster] & ~is_new;
        for (auto& border : c_.border_slots) border.cluster = new_number_[border.cluster] & ~is_new;
        renumber_pairs(kept);
    }

    // Sorted by a, each pair once, with its error where it is still known. Linear: two counting passes, and a mark by
    // which a's other pairs are known. Which pairs go is as good as random: they are overwritten, for the processor is
    // not to guess.
    void renumber_pairs(Index clusters) {
        start_.assign(clusters + 1, 0);
        std::size_t inner = 0;
        for (std::size_t i = 0; i < c_.pairs.size(); ++i) {
            const Index number_a = new_number_[c_.pairs[i].a], number_b = new_number_[c_.pairs[i].b];
            const Index a = number_a & ~is_new, b = number_b & ~is_new;
            pair_errors_[inner] = (number_a | number_b) & is_new ? unknown_error : pair_errors_[i];
            c_.pairs[inner] = {std::min(a, b), std::max(a, b)};
            inner += a != b;
            start_[std::min(a, b) + 1] += a != b;
        }
        std::partial_sum(start_.begin(), start_.end(), start_.begin());
        partners_.resize(inner);
        for (std::size_t i = 0; i < inner; ++i) partners_[start_[c_.pairs[i].a]++] = {c_.pairs[i].b, pair_errors_[i]};
        marks_.assign(clusters, none);
        std::size_t out = 0;
        for (Index a = 0; a < clusters; ++a) {
            for (Index i = a == 0 ? 0 : start_[a - 1]; i < start_[a]; ++i) {
                const auto [b, error] = partners_[i];
                c_.pairs[out] = {a, b};
                pair_errors_[out] = error;
                out += marks_[b] != a;
                marks_[b] = a;
            }
        }
        c_.pairs.resize(out);
        pair_errors_.resize(out);
    }

    Contraction& c_;
    LiveClusters& live_;
    std::vector<Merge>& merges_;
    std::size_t channels_, stride_;
    struct Nearest {
        Index component;
        float distance;
    };
    bool impatient_ = false;
    std::vector<Index> component_; // by cluster
    std::vector<Component> components_;
    std::vector<Nearest> nearest_;   // by component
    std::size_t edges_ = 0;          // of the pairs; what follows are this round's pairs across gaps
    std::vector<float> pair_errors_; // by pair
    std::vector<Index> unknown_;     // pairs whose errors are to be found; likewise the next
    std::vector<ClusterPair> unknown_pairs_;
    std::vector<float> found_errors_;
    std::vector<Rank> best_;  // by cluster: its best pair
    std::vector<Index> into_; // by cluster: the one that it was joined to in this round, or itself
    std::vector<std::uint8_t> taken_, lone_, held_;
    struct Partner {
        Index cluster;
        float error;
    };
    // By cluster: its number after the round, and whether it was made in it. (Live clusters are too
    // few to need the bit.)
    static constexpr Index is_new = Index{1} << 31;
    std::vector<Index> new_number_, start_, marks_;
    std::vector<Partner> partners_;
    std::vector<CodedIndex> curve_, curve_scratch_, order_, order_scratch_;
};

void append(LiveClusters& to, const LiveClusters& from) {
    const auto add = [](auto& x, const auto& y) { x.insert(x.end(), y.begin(), y.end()); };
    add(to.clusters, from.clusters);
    add(to.places, from.places);
    add(to.references, from.references);
    add(to.quadrics, from.quadrics);
}

} // namespace

Contraction contract_part(const PartMesh& part, Index target, const RoundCallback& after_round) {
    Contraction c = PartSetup(part).run();
    Contractor(c).run(target, after_round);
    return c;
}

Contraction join(const Contraction& left, const Contraction& right, Index target, const RoundCallback& after_round) {
    Contraction c;
    c.first_slot = left.first_slot;
    c.end_slot = right.end_slot;
    c.channels = left.channels;
    append(c.live, left.live);
    append(c.live, right.live);
    const Index shift = static_cast<Index>(left.live.size());
    c.pairs = left.pairs;
    const auto add_outer = [&](const Contraction& side, Index side_shift) {
        for (const auto& edge : side.outer_edges)
            if (edge.far_slot < c.first_slot || edge.far_slot >= c.end_slot)
                c.outer_edges.push_back({edge.cluster + side_shift, edge.far_slot});
    };
    add_outer(left, 0);
    add_outer(right, shift);
    // The edges between the two: the far slot of the left's is a border slot of the right.
    for (const auto& edge : left.outer_edges) {
        if (edge.far_slot < right.first_slot || edge.far_slot >= right.end_slot) continue;
        const auto border = std::lower_bound(right.border_slots.begin(), right.border_slots.end(), edge.far_slot,
                                             [](const auto& b, Index slot) { return b.slot < slot; });
        c.pairs.push_back({edge.cluster, border->cluster + shift});
    }
    std::sort(c.pairs.begin(), c.pairs.end());
    c.pairs.erase(std::unique(c.pairs.begin(), c.pairs.end()), c.pairs.end());
    for (const ClusterPair& p : right.pairs) c.pairs.push_back({p.a + shift, p.b + shift});
    // Border slots whose edges all lead to the other side are no border any more; telling them apart is not worth it.
    c.border_slots = left.border_slots;
    for (const auto& border : right.border_slots) c.border_slots.push_back({border.slot, border.cluster + shift});
    Contractor(c).run(target, after_round);
    return c;
}

} // namespace unseen::vdtree
