#include "build/quadric_contraction.h"

#include <bit>
#include <limits>
#include <numeric>
#include <optional>
#include <tuple>

#include <glm/geometric.hpp>

#include "build/component_merger.h"
#include "build/quadric_setup.h"
#include "build/spatial_order.h"
#include "build/triangle_rings.h"

// Vectors wider than the target's are only handed to functions that are inlined.
#pragma GCC diagnostic ignored "-Wpsabi"

namespace unseen::vdtree {

namespace {

// Weight of the squared distance between a cluster's places and its proxy, against that from the planes. It puts what
// the planes do not care for in order, and does not take part in placing.
constexpr float compactness = 1e-4f;
// Across a gap that no edge bridges, the full squared distance counts: joining two parts moves both.
constexpr float gap_weight = 1;
// A round that contracts a smaller share of the clusters takes other than mutually best pairs too: errors that grow
// along a chain would otherwise contract one pair a round.
constexpr std::size_t least_round_share = 16; // one in so many
// Clusters that no edge reaches are paired with this many neighbours each way along a Morton curve.
constexpr std::size_t curve_neighbours = 3;

// Rounds in which a component that is released becomes a single vertex and is taken up by a neighbour.
constexpr std::size_t rounds_to_absorb = 4;

// Components that a cluster keeps open at most, for what it costs to judge a pair grows with them. Beyond, at poles of
// thousands of triangles with coordinates of their own, both sides of a seam may drift apart.
constexpr std::size_t most_components = 24;

// Whether a merge turns triangles over is tested from when one in so many clusters of a part is left, and always among
// so few. From the start contraction would take a sixth more instructions (bunny), for what is small and rare there;
// cuts repair it.
constexpr std::size_t tested_share = 4, always_tested = 2048;

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

// ---- rounds of contraction

class Contractor {
public:
    explicit Contractor(Contraction& c)
        : c_(c), live_(c.live), merges_(c.record.merges), classes_(c.classes), channels_(classes_.total_channels()),
          stride_(classes_.stride()), merger_(live_, classes_), rings_(c), tags_(c.live.size()),
          refusals_(c.live.size(), 0) {
        std::iota(tags_.begin(), tags_.end(), Index{0});
        for (Index k = 0; k < classes_.count; ++k) links_of_each_class_.push_back({k, k});
    }

    void run(Index target, const RoundCallback& after_round) {
        const std::size_t wanted = std::max<Index>(target, 1);
        if (live_.size() <= wanted) return;
        const std::size_t tested_clusters = std::max<std::size_t>(live_.size() / tested_share, always_tested);
        merges_.reserve(live_.size() - wanted);
        find_components();
        if (has_seams()) close_components(true);
        for (std::size_t round = 0; live_.size() > wanted; ++round) {
            const std::size_t before = merges_.size(), clusters = live_.size();
            if (!rings_.is_started() && clusters <= tested_clusters) rings_.start();
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
        std::vector<Contraction::OuterEdge>& edges = c_.outer_edges;
        std::sort(edges.begin(), edges.end());
        edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
        c_.triangles = rings_.left(tags_);
    }

private:
    float* quadric_of(Index cluster) { return live_.quadrics.data() + cluster * stride_; }
    const float* quadric_of(Index cluster) const { return live_.quadrics.data() + cluster * stride_; }
    glm::vec3 offset(ClusterPair p) const { return glm::vec3(live_.places[p.b] - live_.places[p.a]); }
    bool has_seams() const { return !live_.several.empty(); }
    bool are_simple(ClusterPair p) const { return live_.is_simple(p.a) && live_.is_simple(p.b); }

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
    static constexpr float unknown_error = -1, waiting_error = -2; // a pair that waits is unknown a round later

    // What the spread of the two clusters' places around their new one costs.
    template <class F>
    static UNSEEN_INLINE F spread(const Offset<F>& at, const Offset<F>& to, F weight_a, F weight_b) {
        const F x = to.x - at.x, y = to.y - at.y, z = to.z - at.z;
        return compactness *
               (weight_a * (at.x * at.x + at.y * at.y + at.z * at.z) + weight_b * (x * x + y * y + z * z));
    }

    // Errors of as many pairs of simple clusters as F has lanes. `classes` is classes_, here and below, as a constant
    // where the compiler is to unroll.
    template <class F>
    UNSEEN_INLINE void errors_of(const ClusterPair* pairs, const AttributeClasses classes, float* errors) const {
        constexpr std::size_t lanes = sizeof(F) / sizeof(float);
        const std::size_t channels = classes.total_channels();
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
        F qa[most_quadric_floats], qb[most_quadric_floats], sum[most_quadric_floats], raised[most_channels];
        Offset<F> to;
        std::memcpy(&to, offsets, sizeof(to));
        std::memcpy(raised, differences, channels * sizeof(F));
        const float* quadrics = live_.quadrics.data();
        gather(quadrics, a, classes.stride(), qa);
        gather(quadrics, b, classes.stride(), qb);
        add_quadrics(qa, qb, to, raised, classes, sum);
        const Minimum<F> best = minimise(Form<F>::of_all(sum, classes), to, 1);
        const F found = best.error + spread(best.at, to, qa[quadric::weight], qb[quadric::weight]);
        std::memcpy(errors, &found, sizeof(F));
    }
    template <class F>
    UNSEEN_INLINE void errors_of_all(std::span<const ClusterPair> pairs, const AttributeClasses classes,
                                     float* errors) const {
        constexpr std::size_t lanes = sizeof(F) / sizeof(float);
        for (std::size_t i = 0; i < pairs.size(); i += lanes) {
            ClusterPair some[lanes];
            float found[lanes];
            const std::size_t count = std::min(lanes, pairs.size() - i);
            for (std::size_t l = 0; l < lanes; ++l) some[l] = pairs[i + std::min(l, count - 1)];
            errors_of<F>(some, classes, found);
            std::copy_n(found, count, errors + i);
        }
    }
    template <class F>
    UNSEEN_INLINE void errors_of_all(std::span<const ClusterPair> pairs, float* errors) const {
        if (classes_ == only_normals) errors_of_all<F>(pairs, only_normals, errors);
        else if (classes_ == normals_and_uvs) errors_of_all<F>(pairs, normals_and_uvs, errors);
        else errors_of_all<F>(pairs, classes_, errors);
    }
    UNSEEN_AVX2 void errors_by_eights(std::span<const ClusterPair> pairs, float* errors) const {
        errors_of_all<Float8>(pairs, errors);
    }
    // Neither has fused operations, so both give the same bits.
    void find_errors(std::span<const ClusterPair> pairs, float* errors) const {
        if (has_avx2()) errors_by_eights(pairs, errors);
        else errors_of_all<Float4>(pairs, errors);
    }

    // Gaps have no links of their own: what they bridge becomes one.
    std::span<const Link> links_of(std::size_t pair) const {
        if (pair >= c_.links_of_pairs.size()) return links_of_each_class_;
        const LinkRange range = c_.links_of_pairs[pair];
        return std::span(c_.links).subspan(range.first, range.count);
    }

    // What the error of a pair is found from where a cluster has several components.
    struct Candidate {
        Form<float> form;
        Offset<float> to;
        float weight_a, weight_b, unused = 0;
    };
    static_assert(sizeof(Candidate) == 16 * sizeof(float));

    Candidate candidate(std::size_t pair) {
        const ClusterPair p = c_.pairs[pair];
        merger_.unite(p, links_of(pair));
        const glm::vec3 d = offset(p);
        return {merger_.form(), {d.x, d.y, d.z}, quadric_of(p.a)[quadric::weight], quadric_of(p.b)[quadric::weight]};
    }

    // As many as F has lanes.
    template <class F>
    static UNSEEN_INLINE void errors_of(const Candidate* some, float* errors) {
        F columns[16];
        for (std::size_t i = 0; i < 16; i += 4)
            load_columns([&](std::size_t lane) UNSEEN_INLINE_LAMBDA { return &some[lane].form.xx + i; }, columns + i);
        const Form<F> form{columns[0], columns[1], columns[2], columns[3], columns[4],
                           columns[5], columns[6], columns[7], columns[8], columns[9]};
        const Offset<F> to{columns[10], columns[11], columns[12]};
        const Minimum<F> best = minimise(form, to, 1);
        const F found = best.error + spread(best.at, to, columns[13], columns[14]);
        std::memcpy(errors, &found, sizeof(F));
    }

    // The same on every processor: four and four of them.
    void find_errors_of_several() {
        constexpr std::size_t lanes = sizeof(Float4) / sizeof(float);
        candidates_.clear();
        for (const Index pair : several_) candidates_.push_back(candidate(pair));
        candidates_.resize((several_.size() + lanes - 1) / lanes * lanes);
        for (std::size_t i = 0; i < several_.size(); i += lanes) {
            float found[lanes];
            errors_of<Float4>(candidates_.data() + i, found);
            for (std::size_t l = 0; l < lanes && i + l < several_.size(); ++l) pair_errors_[several_[i + l]] = found[l];
        }
    }

    // Ward's measure: by how much the sum of squared distances from the clusters' middles grows.
    float gap_error(ClusterPair p) const {
        const float a = quadric_of(p.a)[quadric::weight], b = quadric_of(p.b)[quadric::weight];
        const glm::vec3 d = offset(p);
        return gap_weight * (a * b / (a + b)) * glm::dot(d, d);
    }

    // Keeps the errors of pairs whose clusters have not changed since the last round. Which are known is as good as random,
    // and the processor is not to guess.
    void update_errors(std::size_t first) {
        pair_errors_.resize(c_.pairs.size(), unknown_error);
        unknown_.resize(c_.pairs.size() - first);
        std::size_t count = 0;
        for (std::size_t i = first; i < c_.pairs.size(); ++i) {
            if (pair_errors_[i] == waiting_error) [[unlikely]] {
                pair_errors_[i] = unknown_error;
                waits_[c_.pairs[i].a] = waits_[c_.pairs[i].b] = 1;
                continue;
            }
            unknown_[count] = static_cast<Index>(i);
            count += pair_errors_[i] < 0;
        }
        unknown_.resize(count);
        several_.clear();
        if (has_seams())
            std::erase_if(unknown_, [&](Index pair) {
                if (are_simple(c_.pairs[pair])) return false;
                several_.push_back(pair);
                return true;
            });
        unknown_pairs_.clear();
        for (const Index pair : unknown_) unknown_pairs_.push_back(c_.pairs[pair]);
        found_errors_.resize(unknown_.size());
        find_errors(unknown_pairs_, found_errors_.data());
        for (std::size_t i = 0; i < unknown_.size(); ++i) pair_errors_[unknown_[i]] = found_errors_[i];
        find_errors_of_several();
    }

    // Lets the pairs from `first` on compete for being the best of their clusters; `gaps`: no edges join them. Ties go
    // to the pair that comes first, for both its clusters, so some pair is always the best of both.
    void compete(std::size_t first, bool gaps) {
        update_errors(first);
        for (std::size_t i = first; i < c_.pairs.size(); ++i) {
            const ClusterPair p = c_.pairs[i];
            if (gaps ? !is_allowed(p) : held_[p.a] != 0) continue; // an edge is within one component
            if (pair_errors_[i] < 0) continue;                     // it waits
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
        for (Index s = 0; s < live_.size(); ++s) any |= (lone_[s] = best_[s].is_none() && !waits_[s]);
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
        waits_.assign(clusters, 0);
        held_.resize(clusters);
        for (Index s = 0; s < clusters; ++s) held_[s] = is_held(s);
        if (has_seams()) {
            several_before_ = live_.several;
            numbers_of_.assign(clusters, none);
            numbers_.clear();
        }
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
            if (p.a == s && best_[p.b] == best_[s] && is_allowed(p)) contract(best_[s]);
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
            if (!taken_[p.a] && !taken_[p.b] && is_allowed(p) && pair_errors_[best.pair()] >= 0) contract(best);
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
                if (contract({rival, s}, std::max(best_[rival].error(), best_[s].error()), false, {})) rival = none;
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

    struct Trial {
        float error;
        bool tested; // for triangles that turn over
    };
    // Where a cluster made of two goes.
    struct Placed {
        Offset<float> from_a;
        glm::dvec3 place;
    };

    // Where the form is least; where that turns a triangle over, at an end or the middle, if that costs hardly more;
    // none, where all do. Where nothing is tested, at the first.
    std::optional<Placed> place(const Form<double>& form, ClusterPair p, const Trial& trial) {
        constexpr double most_costly = 1.5; // times the pair's error, which puts it in order
        constexpr int steps = 3;            // see minimise(): what is 100 times as steep as flat is exact to 1e-6
        const glm::vec3 d = offset(p);
        const Offset<double> to{d.x, d.y, d.z};
        const Placed best = at_offset(minimise(form, to, steps).at, p);
        if (!trial.tested || !rings_.turns(tags_[p.a], tags_[p.b], best.place)) return best;
        std::array<Offset<double>, 3> others{{{0, 0, 0}, to, {to.x / 2, to.y / 2, to.z / 2}}};
        std::ranges::sort(others, {}, form);
        for (const Offset<double>& other : others) {
            const Placed placed = at_offset(other, p);
            if (form(other) <= most_costly * trial.error && !rings_.turns(tags_[p.a], tags_[p.b], placed.place))
                return placed;
        }
        return {};
    }

    // At an end exactly, where it is as near as that.
    Placed at_offset(const Offset<double>& offset_from_a, ClusterPair p) const {
        constexpr double same_place = 1e-5; // share of the pair's distance: floats do not know better
        const glm::vec3 d = offset(p);
        const glm::dvec3 at(offset_from_a.x, offset_from_a.y, offset_from_a.z), to(d);
        const double slack = same_place * same_place * glm::dot(to, to);
        if (glm::dot(at, at) <= slack) return {{0, 0, 0}, live_.places[p.a]};
        if (glm::dot(at - to, at - to) <= slack) return {{d.x, d.y, d.z}, live_.places[p.b]};
        const glm::vec3 rounded(at);
        return {{rounded.x, rounded.y, rounded.z}, live_.places[p.a] + glm::dvec3(rounded)};
    }

    // The sum's base, after its blocks and the place have moved to the new place. What the clusters were spread before
    // is in it.
    void finish_base(float* base, const Offset<float>& at, ClusterPair p) {
        const glm::vec3 d = offset(p);
        base[quadric::k] =
            std::max(base[quadric::k], 0.0f) +
            spread(at, {d.x, d.y, d.z}, quadric_of(p.a)[quadric::weight], quadric_of(p.b)[quadric::weight]);
        std::copy_n(base, std::size_t{quadric::base_size}, quadric_of(p.a));
    }

    // Gives a's numbers to both, if they can be placed.
    std::optional<Placed> unite_simple(ClusterPair p, const Trial& trial) {
        if (classes_ == only_normals) return unite_simple(p, trial, only_normals);
        if (classes_ == normals_and_uvs) return unite_simple(p, trial, normals_and_uvs);
        return unite_simple(p, trial, classes_);
    }
    UNSEEN_INLINE std::optional<Placed> unite_simple(ClusterPair p, const Trial& trial,
                                                     const AttributeClasses classes) {
        const std::size_t channels = classes.total_channels();
        float sum[most_quadric_floats], raised[most_channels];
        float *a = quadric_of(p.a), *b = quadric_of(p.b), *references = live_.references.data() + p.a * channels;
        const glm::vec3 d = offset(p);
        const Offset<float> to{d.x, d.y, d.z};
        for (std::size_t c = 0; c < channels; ++c) raised[c] = live_.references[p.b * channels + c] - references[c];
        add_quadrics(a, b, to, raised, classes, sum);
        const std::optional<Placed> placed = place(Form<double>::of_all(sum, classes), p, trial);
        if (!placed) return {};
        move_base(sum, placed->from_a);
        for (std::size_t k = 0; k < classes.count; ++k)
            move_block(sum + classes.first_float(k), placed->from_a, references + classes.first_channel(k),
                       classes.channels[k], sum);
        finish_base(sum, placed->from_a, p);
        const std::size_t blocks = quadric::base_size;
        std::copy_n(sum + blocks, classes.first_float(classes.count) - blocks, a + blocks);
        return placed;
    }

    std::optional<Placed> unite_several(ClusterPair p, const Trial& trial, std::span<const Link> links) {
        merger_.unite(p, links);
        const std::optional<Placed> placed = place(Form<double>::of(merger_.form()), p, trial);
        if (!placed) return {};
        move_base(merger_.base(), placed->from_a);
        const std::span<ClassComponent> components = merger_.components();
        for (ClassComponent& c : components)
            move_block(c.block.data(), placed->from_a, c.references.data(), classes_.channels[c.attribute_class],
                       merger_.base());
        finish_base(merger_.base(), placed->from_a, p);
        const Index before = static_cast<Index>(numbers_.size());
        const Index of_a = several_before_[p.a].count == 0 ? classes_.count : several_before_[p.a].count;
        numbers_of_[p.a] = before;
        numbers_of_[p.b] = before + of_a;
        numbers_.insert(numbers_.end(), merger_.numbers().begin(), merger_.numbers().end());
        store_components(p.a, components);
        return placed;
    }

    // At the end of the list; close_gaps() tidies it up.
    void store_components(Index cluster, std::span<const ClassComponent> components) {
        const Index count = static_cast<Index>(components.size());
        if (count > classes_.count) {
            live_.several[cluster] = {static_cast<Index>(live_.components.size()), count};
            live_.components.insert(live_.components.end(), components.begin(), components.end());
        } else {
            make_simple(cluster, components);
        }
    }

    // With one component of each class, in the classes' order.
    void make_simple(Index cluster, std::span<const ClassComponent> components) {
        live_.several[cluster] = {};
        for (std::size_t k = 0; k < classes_.count; ++k) {
            std::copy_n(components[k].block.data(), block_size(classes_.channels[k]),
                        quadric_of(cluster) + classes_.first_float(k));
            std::copy_n(components[k].references.data(), classes_.channels[k],
                        live_.references.data() + cluster * channels_ + classes_.first_channel(k));
        }
    }

    // Pairs that were refused often are not tested any more, or a part of the surface that cannot go on would wait for
    // all others; nor are the last clusters of a component, whose triangles have to turn.
    bool is_tested(ClusterPair p, bool gap) {
        constexpr std::uint8_t patience = 6; // refusals
        constexpr Index last_clusters = 4;
        if (gap || impatient_ || !rings_.is_started() || std::min(refusals_[p.a], refusals_[p.b]) >= patience)
            return false;
        const Component& c = components_[component_of(p.a)];
        return c.open || c.clusters > last_clusters;
    }

    void contract(const Rank& best) {
        const ClusterPair p = c_.pairs[best.pair()];
        if (!contract(p, best.error(), best.pair() >= edges_, links_of(best.pair())))
            pair_errors_[best.pair()] = waiting_error;
    }

    // Joins b to a: a's slot holds the new cluster. False where a triangle would turn over.
    bool contract(ClusterPair p, float error, bool gap, std::span<const Link> links) {
        const Trial trial{error, is_tested(p, gap)};
        const std::optional<Placed> placed = are_simple(p) ? unite_simple(p, trial) : unite_several(p, trial, links);
        if (!placed) {
            for (const Index s : {p.a, p.b}) refusals_[s] = static_cast<std::uint8_t>(std::min(refusals_[s] + 1, 255));
            return false;
        }
        note_vanishing(p, gap);
        note_components(p);
        taken_[p.a] = taken_[p.b] = 1;
        into_[p.b] = p.a;
        refusals_[p.a] = 0;
        live_.places[p.a] = placed->place;
        rings_.unite(tags_[p.a], tags_[p.b], placed->place);
        const float deviation = std::sqrt(error / quadric_of(p.a)[quadric::weight]);
        LiveCluster& made = live_[p.a];
        made.deviation = std::max({deviation, made.deviation, live_[p.b].deviation});
        merges_.push_back({made.name, live_[p.b].name, error, made.deviation, live_.places[p.a]});
        return true;
    }

    // Renumbers the clusters without those that were joined to others, and the edges with them.
    void close_gaps() {
        new_number_.resize(live_.size());
        if (has_seams()) {
            for (auto& edge : c_.outer_edges) renumber_components(edge.cluster, edge.components);
            for (auto& border : c_.border_leaves) renumber_components(border.cluster, border.components);
        }
        Index kept = 0;
        for (Index s = 0; s < live_.size(); ++s) {
            if (into_[s] != s) continue;
            new_number_[s] = kept | (taken_[s] ? is_new : 0);
            if (kept != s) {
                live_[kept] = live_[s];
                live_.places[kept] = live_.places[s];
                component_[kept] = component_[s];
                tags_[kept] = tags_[s];
                refusals_[kept] = refusals_[s];
                if (has_seams()) live_.several[kept] = live_.several[s];
                std::copy_n(quadric_of(s), stride_, quadric_of(kept));
                std::copy_n(live_.references.data() + s * channels_, channels_,
                            live_.references.data() + kept * channels_);
            }
            ++kept;
        }
        for (Index s = 0; s < live_.size(); ++s) // `into_` of a cluster that was joined is one that was not
            new_number_[s] = new_number_[into_[s]];
        live_.clusters.resize(kept);
        live_.places.resize(kept);
        component_.resize(kept);
        tags_.resize(kept);
        refusals_.resize(kept);
        live_.quadrics.resize(kept * stride_);
        live_.references.resize(kept * channels_);
        for (auto& edge : c_.outer_edges) edge.cluster = new_number_[edge.cluster] & ~is_new;
        for (auto& border : c_.border_leaves) border.cluster = new_number_[border.cluster] & ~is_new;
        if (has_seams()) {
            live_.several.resize(kept);
            pairs_before_ = c_.pairs;
        }
        renumber_pairs(kept);
        if (!has_seams()) return;
        renumber_links();
        close_components(false);
    }

    // Sorted by a, each pair once, with its error where it is still known. Linear: two counting passes, and a mark by
    // which a's other pairs are known. Which pairs go is as good as random: they are overwritten, for the processor is
    // not to guess.
    void renumber_pairs(Index clusters) {
        const bool seams = has_seams();
        start_.assign(clusters + 1, 0);
        std::size_t inner = 0;
        if (seams) {
            origin_.resize(c_.pairs.size());
            origin_of_partner_.resize(c_.pairs.size());
            pair_now_.assign(c_.pairs.size(), none);
            pair_with_.resize(clusters);
        }
        for (std::size_t i = 0; i < c_.pairs.size(); ++i) {
            const Index number_a = new_number_[c_.pairs[i].a], number_b = new_number_[c_.pairs[i].b];
            const Index a = number_a & ~is_new, b = number_b & ~is_new;
            pair_errors_[inner] = (number_a | number_b) & is_new ? unknown_error : pair_errors_[i];
            c_.pairs[inner] = {std::min(a, b), std::max(a, b)};
            if (seams) origin_[inner] = static_cast<Index>(i);
            inner += a != b;
            start_[std::min(a, b) + 1] += a != b;
        }
        std::partial_sum(start_.begin(), start_.end(), start_.begin());
        partners_.resize(inner);
        for (std::size_t i = 0; i < inner; ++i) {
            const Index place = start_[c_.pairs[i].a]++;
            partners_[place] = {c_.pairs[i].b, pair_errors_[i]};
            if (seams) origin_of_partner_[place] = origin_[i];
        }
        marks_.assign(clusters, none);
        std::size_t out = 0;
        for (Index a = 0; a < clusters; ++a) {
            for (Index i = a == 0 ? 0 : start_[a - 1]; i < start_[a]; ++i) {
                const auto [b, error] = partners_[i];
                c_.pairs[out] = {a, b};
                pair_errors_[out] = error;
                const bool is_first = marks_[b] != a;
                if (seams) {
                    if (is_first) pair_with_[b] = static_cast<Index>(out);
                    pair_now_[origin_of_partner_[i]] = pair_with_[b];
                }
                out += is_first;
                marks_[b] = a;
            }
        }
        c_.pairs.resize(out);
        pair_errors_.resize(out);
    }

    // ---- components of attribute classes

    // The number that a component of a cluster has after the round.
    Index new_component(Index cluster_before, Index number) const {
        const Index first = numbers_of_[cluster_before];
        return first == none ? number : numbers_[first + number];
    }
    void renumber_components(Index cluster_before, LeafComponents& components) const {
        for (std::size_t k = 0; k < classes_.count; ++k)
            if (components[k] != no_component) components[k] = new_component(cluster_before, components[k]);
    }

    // Links of all pairs that have become one go with it, each once.
    void renumber_links() {
        links_of_pairs_before_.swap(c_.links_of_pairs);
        links_before_.swap(c_.links);
        c_.links_of_pairs.assign(c_.pairs.size(), {});
        const auto for_each_before = [&](auto&& f) {
            for (Index i = 0; i < pairs_before_.size(); ++i) {
                const Index pair = pair_now_[i];
                if (pair == none || are_simple(c_.pairs[pair])) continue;
                const ClusterPair before = pairs_before_[i];
                const bool were_simple = several_before_[before.a].count == 0 && several_before_[before.b].count == 0;
                const LinkRange range = were_simple ? LinkRange{} : links_of_pairs_before_[i];
                f(before, pair,
                  were_simple ? std::span<const Link>(links_of_each_class_)
                              : std::span<const Link>(links_before_).subspan(range.first, range.count));
            }
        };
        for_each_before([&](ClusterPair, Index pair, std::span<const Link> links) {
            c_.links_of_pairs[pair].count += static_cast<Index>(links.size());
        });
        Index first = 0;
        for (LinkRange& range : c_.links_of_pairs) {
            range.first = first;
            first += std::exchange(range.count, 0);
        }
        c_.links.resize(first);
        for_each_before([&](ClusterPair before, Index pair, std::span<const Link> links) {
            LinkRange& range = c_.links_of_pairs[pair];
            const bool turns = (new_number_[before.a] & ~is_new) != c_.pairs[pair].a;
            for (const Link& link : links) {
                const Index a = new_component(before.a, link.a), b = new_component(before.b, link.b);
                c_.links[range.first + range.count++] = turns ? Link{b, a} : Link{a, b};
            }
        });
        for (std::size_t i = 0; i < c_.pairs.size(); ++i) {
            if (pair_errors_[i] >= 0) continue; // its clusters are as before, and so are its links
            LinkRange& range = c_.links_of_pairs[i];
            const auto begin = c_.links.begin() + range.first, end = begin + range.count;
            std::sort(begin, end);
            range.count = static_cast<Index>(std::unique(begin, end) - begin);
        }
    }

    // Closes what nothing links any more, of the clusters that were made in this round, or of all; and the lightest
    // where there are too many. Tidies up the list of components.
    void close_components(bool all) {
        find_linked();
        std::vector<ClassComponent>& list = tidy_;
        list.clear();
        numbers_of_.assign(live_.size(), none);
        numbers_.clear();
        for (Index s = 0; s < live_.size(); ++s) {
            LiveClusters::Several& several = live_.several[s];
            if (several.count == 0) continue;
            const auto now = std::span(live_.components).subspan(several.first, several.count);
            const bool is_chosen = all || has_to_close(several);
            if (is_chosen) choose_components(s);
            if (is_chosen && chosen_.size() == classes_.count) {
                make_simple(s, chosen_);
            } else {
                const std::span<const ClassComponent> kept = is_chosen ? std::span(chosen_) : now;
                several = {static_cast<Index>(list.size()), static_cast<Index>(kept.size())};
                list.insert(list.end(), kept.begin(), kept.end());
            }
        }
        live_.components.swap(list);
        if (numbers_.empty()) return;
        for (auto& edge : c_.outer_edges) renumber_components(edge.cluster, edge.components);
        for (auto& border : c_.border_leaves) renumber_components(border.cluster, border.components);
        for (std::size_t i = 0; i < c_.pairs.size(); ++i) drop_closed_links(i);
    }

    void find_linked() {
        linked_.assign(live_.components.size(), 0);
        const auto mark = [&](Index cluster, Index number) {
            if (!live_.is_simple(cluster) && number != no_component) linked_[live_.several[cluster].first + number] = 1;
        };
        for (std::size_t i = 0; i < c_.pairs.size(); ++i)
            for (const Link& link : links_of(i)) mark(c_.pairs[i].a, link.a), mark(c_.pairs[i].b, link.b);
        for (const auto& edge : c_.outer_edges)
            for (std::size_t k = 0; k < classes_.count; ++k) mark(edge.cluster, edge.components[k]);
    }

    bool has_to_close(const LiveClusters::Several& several) const {
        const auto linked = std::span(linked_).subspan(several.first, several.count);
        return several.count > most_components || std::ranges::find(linked, 0) != linked.end();
    }

    // Which components of a cluster stay, in chosen_. The others' best values are eliminated from the base.
    void choose_components(Index s) {
        const LiveClusters::Several several = live_.several[s];
        const auto now = std::span(live_.components).subspan(several.first, several.count);
        const auto weight = [&](Index i) {
            return now[i].block[classes_.channels[now[i].attribute_class] * quadric::row_size];
        };
        // The linked and heavy ones first; of each class one.
        order_of_components_.resize(several.count);
        std::iota(order_of_components_.begin(), order_of_components_.end(), Index{0});
        std::ranges::sort(order_of_components_, {},
                          [&](Index i) { return std::tuple(!linked_[several.first + i], -weight(i), i); });
        numbers_of_[s] = static_cast<Index>(numbers_.size());
        numbers_.resize(numbers_.size() + several.count, no_component);
        Index* numbers = numbers_.data() + numbers_of_[s];
        chosen_.resize(classes_.count);
        std::array<bool, most_classes> has{};
        for (const Index i : order_of_components_) {
            const Index k = now[i].attribute_class;
            if (!std::exchange(has[k], true)) {
                numbers[i] = k;
                chosen_[k] = now[i];
            } else if (linked_[several.first + i] && chosen_.size() < most_components) {
                numbers[i] = static_cast<Index>(chosen_.size());
                chosen_.push_back(now[i]);
            } else {
                close(quadric_of(s), now[i]);
            }
        }
    }

    void close(float* base, const ClassComponent& c) const {
        using namespace quadric;
        const std::size_t channels = classes_.channels[c.attribute_class];
        Form<float> form = Form<float>::of_base(base);
        form.eliminate(c.block.data(), channels);
        base[xx] = form.xx, base[xy] = form.xy, base[xz] = form.xz;
        base[yy] = form.yy, base[yz] = form.yz, base[zz] = form.zz;
        base[hx] = form.hx, base[hy] = form.hy, base[hz] = form.hz;
        base[quadric::k] = std::max(form.k, 0.0f);
    }

    void drop_closed_links(std::size_t pair) {
        const ClusterPair p = c_.pairs[pair];
        LinkRange& range = c_.links_of_pairs[pair];
        const auto links = std::span(c_.links).subspan(range.first, std::exchange(range.count, 0));
        if (are_simple(p)) return;
        for (const Link& link : links) {
            const Link now{new_component(p.a, link.a), new_component(p.b, link.b)};
            if (now.a != no_component && now.b != no_component) c_.links[range.first + range.count++] = now;
        }
    }

    Contraction& c_;
    LiveClusters& live_;
    std::vector<Merge>& merges_;
    AttributeClasses classes_;
    std::size_t channels_, stride_;
    ComponentMerger merger_;
    TriangleRings rings_;
    std::vector<Index> tags_;            // by cluster: its tag in rings_
    std::vector<std::uint8_t> refusals_; // by cluster: how often a triangle would have turned over since it was made
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
    std::vector<Index> several_; // those of them where a cluster has several components of a class
    std::vector<Candidate> candidates_;
    std::vector<float> found_errors_;
    std::vector<Rank> best_;  // by cluster: its best pair
    std::vector<Index> into_; // by cluster: the one that it was joined to in this round, or itself
    std::vector<std::uint8_t> taken_, lone_, held_, waits_;
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

    // What a round does to components. A cluster's components get the numbers that lie in numbers_ from numbers_of_ of
    // it on; none: they keep theirs.
    std::vector<Link> links_of_each_class_, links_before_;
    std::vector<LinkRange> links_of_pairs_before_;
    std::vector<LiveClusters::Several> several_before_;
    std::vector<ClusterPair> pairs_before_;
    std::vector<Index> pair_now_;                               // by pair before the round; none: its clusters are one
    std::vector<Index> origin_, origin_of_partner_, pair_with_; // see renumber_pairs()
    std::vector<Index> numbers_of_, numbers_, order_of_components_;
    std::vector<std::uint8_t> linked_; // by component
    std::vector<ClassComponent> chosen_, tidy_;
};

void append(LiveClusters& to, const LiveClusters& from) {
    const auto add = [](auto& x, const auto& y) { x.insert(x.end(), y.begin(), y.end()); };
    const Index shift = static_cast<Index>(to.components.size());
    if (!to.several.empty() || !from.several.empty()) {
        to.several.resize(to.size());
        to.several.insert(to.several.end(), from.several.begin(), from.several.end());
        to.several.resize(to.size() + from.size());
        for (std::size_t i = to.size(); i < to.several.size(); ++i) to.several[i].first += shift;
    }
    add(to.components, from.components);
    add(to.clusters, from.clusters);
    add(to.places, from.places);
    add(to.references, from.references);
    add(to.quadrics, from.quadrics);
}

// The edges between two neighbouring ranges, and the edges of each, in one list, each once, with its links.
class PairJoiner {
public:
    PairJoiner(Contraction& to, const Contraction& left, const Contraction& right)
        : to_(to), left_(left), right_(right), shift_(static_cast<Index>(left.live.size())) {}

    void run() {
        join_triangles();
        for (const auto& edge : left_.outer_edges)
            if (edge.far_leaf >= right_.first_leaf && edge.far_leaf < right_.end_leaf) add_edge(edge);
        std::sort(crossing_.begin(), crossing_.end());
        auto next = crossing_.begin();
        for (std::size_t i = 0; i < left_.pairs.size(); ++i) {
            for (; next != crossing_.end() && next->pair < left_.pairs[i]; ++next) add_crossing(*next);
            add_pair(left_, i, 0);
        }
        for (; next != crossing_.end(); ++next) add_crossing(*next);
        for (std::size_t i = 0; i < right_.pairs.size(); ++i) add_pair(right_, i, shift_);
    }

private:
    struct Crossing {
        ClusterPair pair;
        Link link;
        auto operator<=>(const Crossing&) const = default;
    };

    bool has_seams() const { return !to_.live.several.empty(); }

    static auto border_of(const Contraction& side, Index leaf) {
        return std::ranges::lower_bound(side.border_leaves, leaf, {}, &Contraction::BorderLeaf::leaf);
    }

    // Triangles of both sides are those of the left.
    void join_triangles() {
        const auto is_inside = [&](Index leaf) { return leaf >= left_.first_leaf && leaf < right_.end_leaf; };
        for (const Contraction* side : {&left_, &right_})
            for (const auto& leaf : side->outside)
                if (!is_inside(leaf.leaf)) to_.outside.push_back(leaf);
        const auto by_leaf = [](const auto& a, const auto& b) { return a.leaf < b.leaf; };
        std::sort(to_.outside.begin(), to_.outside.end(), by_leaf);
        const auto is_repeated = [](const auto& a, const auto& b) { return a.leaf == b.leaf; };
        to_.outside.erase(std::unique(to_.outside.begin(), to_.outside.end(), is_repeated), to_.outside.end());
        for (const Contraction* side : {&left_, &right_}) {
            const bool is_right = side == &right_;
            const Contraction& far = is_right ? left_ : right_;
            for (const LiveTriangle& t : side->triangles) {
                LiveTriangle now = t;
                bool has_left = !is_right;
                for (Index& corner : now.corners) {
                    if (!(corner & LiveTriangle::is_outside)) {
                        corner += is_right ? shift_ : 0;
                        continue;
                    }
                    const Index leaf = side->outside[corner & ~LiveTriangle::is_outside].leaf;
                    has_left |= is_right && is_inside(leaf);
                    if (is_inside(leaf)) {
                        corner = border_of(far, leaf)->cluster + (is_right ? 0 : shift_);
                    } else {
                        const auto at =
                            std::ranges::lower_bound(to_.outside, leaf, {}, &Contraction::OutsideLeaf::leaf);
                        corner = LiveTriangle::is_outside | static_cast<Index>(at - to_.outside.begin());
                    }
                }
                if ((!is_right || !has_left) && !uses_a_vertex_twice(now.corners)) to_.triangles.push_back(now);
            }
        }
    }

    // The far leaf of the left's is a border leaf of the right.
    void add_edge(const Contraction::OuterEdge& edge) {
        const auto border = border_of(right_, edge.far_leaf);
        const ClusterPair pair{edge.cluster, border->cluster + shift_};
        if (to_.live.is_simple(pair.a) && to_.live.is_simple(pair.b)) {
            crossing_.push_back({pair, {no_component, no_component}});
            return;
        }
        for (std::size_t k = 0; k < to_.classes.count; ++k)
            crossing_.push_back({pair, {edge.components[k], border->components[k]}});
    }

    void add_crossing(const Crossing& crossing) {
        if (to_.pairs.empty() || to_.pairs.back() != crossing.pair) start_pair(crossing.pair);
        if (crossing.link.a == no_component || crossing.link.b == no_component) return;
        LinkRange& range = to_.links_of_pairs.back();
        if (range.count > 0 && to_.links.back() == crossing.link) return;
        to_.links.push_back(crossing.link);
        ++range.count;
    }

    void add_pair(const Contraction& side, std::size_t i, Index shift) {
        start_pair({side.pairs[i].a + shift, side.pairs[i].b + shift});
        if (side.links_of_pairs.empty()) return;
        const LinkRange range = side.links_of_pairs[i];
        const auto links = std::span(side.links).subspan(range.first, range.count);
        to_.links.insert(to_.links.end(), links.begin(), links.end());
        to_.links_of_pairs.back().count = range.count;
    }

    void start_pair(ClusterPair pair) {
        to_.pairs.push_back(pair);
        if (has_seams()) to_.links_of_pairs.push_back({static_cast<Index>(to_.links.size()), 0});
    }

    Contraction& to_;
    const Contraction &left_, &right_;
    Index shift_;
    std::vector<Crossing> crossing_;
};

} // namespace

Contraction contract_part(const PartMesh& part, Index target, const RoundCallback& after_round) {
    Contraction c = set_up(part);
    Contractor(c).run(target, after_round);
    return c;
}

Contraction join(const Contraction& left, const Contraction& right, Index target, const RoundCallback& after_round) {
    Contraction c;
    c.first_slot = left.first_slot;
    c.end_slot = right.end_slot;
    c.first_leaf = left.first_leaf;
    c.end_leaf = right.end_leaf;
    c.classes = left.classes;
    append(c.live, left.live);
    append(c.live, right.live);
    const Index shift = static_cast<Index>(left.live.size());
    PairJoiner(c, left, right).run();
    const auto add_outer = [&](const Contraction& side, Index side_shift) {
        for (const auto& edge : side.outer_edges)
            if (edge.far_leaf < c.first_leaf || edge.far_leaf >= c.end_leaf)
                c.outer_edges.push_back({edge.cluster + side_shift, edge.far_leaf, edge.components});
    };
    add_outer(left, 0);
    add_outer(right, shift);
    // Border leaves whose edges all lead to the other side are no border any more; telling them apart is not worth it.
    c.border_leaves = left.border_leaves;
    for (const auto& border : right.border_leaves)
        c.border_leaves.push_back({border.leaf, border.cluster + shift, border.components});
    Contractor(c).run(target, after_round);
    return c;
}

} // namespace unseen::vdtree
