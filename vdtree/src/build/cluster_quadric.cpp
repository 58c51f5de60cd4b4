// Pair contraction by quadric error over position and attribute classes: normals, texture coordinates, and colours with
// luminance (Garland and Heckbert 1997, 1998).
//
// The places are parted by a kd-tree, each part is contracted by itself to a small share of its places, and the parts are
// joined up the kd-tree while contraction goes on (see quadric_contraction.h). The parts depend on the mesh alone, so the
// result does not depend on threads. Within a part, contraction runs in rounds: each cluster chooses its best partner, and
// pairs that choose each other are contracted. That is nearest-neighbour agglomeration: the hierarchy differs little from
// strictly greedy order, but the work is linear a round, cache-friendly, and the tree is balanced.
#include <unseen/vdtree/builder.h>

#include <numeric>

#include <glm/geometric.hpp>

#include <unseen/vdtree/internal/parallel.h>
#include <unseen/vdtree/internal/team.h>

#include "build/attribute_scales.h"
#include "build/progress_counter.h"
#include "build/protection.h"
#include "build/quadric.h"
#include "build/quadric_contraction.h"
#include "build/spatial_order.h"
#include "tree/message.h"

namespace unseen::vdtree {

namespace {

// Largest number of places in a part, so that its quadrics fit a core's cache.
constexpr Index largest_part = 1 << 15;
// Parts, and joined parts, are contracted to at most this many clusters: one in 32 of a full part. Few enough that
// joining costs next to nothing, many enough that those along the border of the part, which had fewer partners to
// choose from, are a small share.
constexpr Index part_target = largest_part / 32;

// Attributes count as if they were within this many extents, so that stray values stay finite when squared.
constexpr double largest_value = 1e3;

// ---- numbering of the places by space

// The begin of part `part` of `parts`.
Index part_begin(std::size_t part, std::size_t parts, std::size_t slots) {
    return static_cast<Index>(static_cast<std::uint64_t>(part) * slots / parts);
}

// Places ("slots") in an order in which every part is a range, and the leaves in the order of their slots.
struct SpatialNumbering {
    std::size_t parts = 1;            // a power of two
    Index folding = 0;                // slots that the parts have; then come places that never fold, in no part
    std::vector<Index> place_of_slot; // vertex of the mesh
    std::vector<Index> first_leaf;    // by slot, one longer: into `leaves`
    std::vector<Index> leaves;        // by number in the order: the input's leaf
    std::vector<Index> number;        // by the input's leaf: where it is in `leaves`
};

class KdPartition {
public:
    KdPartition(std::span<const glm::dvec3> positions, std::span<Index> slots, std::size_t parts)
        : slots_(slots), items_(slots.size()), parts_(parts) {
        parallel_loop(std::size_t{0}, slots.size(), [&](std::size_t i) {
            items_[i] = {positions[slots[i]], slots[i]};
        });
    }

    // Puts the slots of parts `first` .. `end` - 1 in order; the others may be anywhere.
    void run(std::size_t first, std::size_t end) {
        wanted_first_ = first;
        wanted_end_ = end;
        split(0, parts_);
    }

private:
    // Positions go with the slots, so that nothing is looked up.
    struct Item {
        glm::dvec3 at;
        Index slot;
    };
    // Halves along the longest side of the bounding box, until there is one part; ties by vertex number.
    void split(std::size_t first_part, std::size_t parts) {
        if (first_part >= wanted_end_ || first_part + parts <= wanted_first_) return;
        const auto begin_of = [&](std::size_t part) { return part_begin(part, parts_, slots_.size()); };
        const Index begin = begin_of(first_part), middle = begin_of(first_part + parts / 2),
                    end = begin_of(first_part + parts);
        const std::span<Item> items = std::span(items_).subspan(begin, end - begin);
        if (parts == 1) return sort_along_curve(items, slots_.subspan(begin, end - begin));
        const Box box = box_around(items, &Item::at);
        const glm::dvec3 size = box.size();
        const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
        std::ranges::nth_element(items, items.begin() + (middle - begin), {},
                                 [&](const Item& item) { return std::pair(item.at[axis] - box.low[axis], item.slot); });
        parallel_loop(std::size_t{0}, std::size_t{2},
                      [&](std::size_t half) { split(first_part + half * (parts / 2), parts / 2); });
    }

    // Equal codes by vertex number.
    static void sort_along_curve(std::span<const Item> items, std::span<Index> slots) {
        const MortonGrid grid(box_around(items, &Item::at));
        std::vector<CodedIndex> keys(items.size()), scratch(items.size());
        for (std::size_t i = 0; i < items.size(); ++i) keys[i] = {grid.code(items[i].at), items[i].slot};
        sort_by_code(keys, scratch);
        for (auto run = keys.begin(); run != keys.end();) {
            const auto end =
                std::find_if(run, keys.end(), [&](const CodedIndex& key) { return key.code != run->code; });
            std::sort(run, end, [](const CodedIndex& a, const CodedIndex& b) { return a.index < b.index; });
            run = end;
        }
        for (std::size_t i = 0; i < keys.size(); ++i) slots[i] = keys[i].index;
    }

    std::span<Index> slots_;
    std::vector<Item> items_;
    std::size_t parts_, wanted_first_ = 0, wanted_end_ = 0;
};

// Which member of a team works on which parts: each on a run of them.
struct Members {
    Team* team = nullptr; // none: the only member
    std::size_t parts = 1;

    std::size_t count() const {
        return team ? std::min<std::size_t>(static_cast<std::size_t>(team->size()), parts) : 1;
    }
    std::size_t rank() const { return team ? static_cast<std::size_t>(team->rank()) : 0; }
    bool has_part() const { return rank() < count(); } // there may be more members than parts
    std::size_t first_part(std::size_t member) const { return member * parts / count(); }
    // The member that has the first part of node `i` of a level of the kd-tree with `level` nodes.
    std::size_t owner(std::size_t i, std::size_t level) const {
        return ((i * (parts / level) + 1) * count() - 1) / parts;
    }
};

Error strange_message() {
    return {ErrorCode::malformed_data,
            "A process of the team sent something else than its part: all must run the same program on the same mesh."};
}

// Each member has put its own slots in order: all get those of all, by way of member 0.
Result<void> share_slots(std::span<Index> slots, const Members& members) {
    const auto own_slots = [&](std::size_t member) {
        const Index begin = part_begin(members.first_part(member), members.parts, slots.size());
        return slots.subspan(begin, part_begin(members.first_part(member + 1), members.parts, slots.size()) - begin);
    };
    const auto receive = [&](std::size_t member, std::span<Index> to) {
        const std::vector<std::byte> bytes = members.team->receive(static_cast<int>(member));
        if (bytes.size() != to.size_bytes()) return false;
        std::memcpy(to.data(), bytes.data(), bytes.size());
        return true;
    };
    if (members.rank() != 0) {
        members.team->send(0, std::as_bytes(own_slots(members.rank())));
        if (!receive(0, slots)) return strange_message();
        return {};
    }
    for (std::size_t member = 1; member < members.count(); ++member)
        if (!receive(member, own_slots(member))) return strange_message();
    for (std::size_t member = 1; member < members.count(); ++member)
        members.team->send(static_cast<int>(member), std::as_bytes(slots));
    return {};
}

// How many parts: a power of two.
std::size_t part_count(std::size_t slots) {
    std::size_t parts = 1;
    while (parts * largest_part < slots) parts *= 2;
    return parts;
}

Index folding_places(const ClusterInput& input) {
    const auto all = static_cast<Index>(input.mesh.positions.size());
    return input.weights.empty() ? all : static_cast<Index>(std::ranges::count_if(input.weights, may_fold));
}

Result<SpatialNumbering> number_by_space(const ClusterInput& input, const Members& members) {
    SpatialNumbering n;
    n.parts = members.parts;
    const std::span<const Index> places = input.leaves.places;
    const Index slots = static_cast<Index>(input.mesh.positions.size()), leaves = static_cast<Index>(places.size());
    n.place_of_slot.resize(slots);
    std::iota(n.place_of_slot.begin(), n.place_of_slot.end(), Index{0});
    n.folding = folding_places(input);
    if (n.folding < slots)
        std::stable_partition(n.place_of_slot.begin(), n.place_of_slot.end(),
                              [&](Index place) { return may_fold(input.weights[place]); });
    const std::span<Index> folding = std::span(n.place_of_slot).first(n.folding);
    KdPartition(input.mesh.positions, folding, n.parts)
        .run(members.first_part(members.rank()), members.first_part(members.rank() + 1));
    if (members.count() > 1)
        if (const auto shared = share_slots(folding, members); !shared) return shared.error();

    n.first_leaf.assign(slots + 1, 0);
    n.leaves.resize(leaves);
    n.number.resize(leaves);
    std::vector<Index> slot_of_place(slots);
    for (Index s = 0; s < slots; ++s) slot_of_place[n.place_of_slot[s]] = s;
    for (const Index place : places) ++n.first_leaf[slot_of_place[place] + 1];
    std::partial_sum(n.first_leaf.begin(), n.first_leaf.end(), n.first_leaf.begin());
    std::vector<Index> next(n.first_leaf.begin(), n.first_leaf.end() - 1);
    for (Index leaf = 0; leaf < leaves; ++leaf) n.leaves[n.number[leaf] = next[slot_of_place[places[leaf]]]++] = leaf;
    return n;
}

// ---- what the parts are made from

class PartMaker {
public:
    PartMaker(const ClusterInput& input, const SpatialNumbering& numbering) : input_(input), numbering_(numbering) {
        measure();
        list_triangles();
    }

    PartMesh make(std::size_t part) const {
        PartMesh out;
        const Index first_slot = part_begin(part, numbering_.parts, slots()),
                    end_slot = part_begin(part + 1, numbering_.parts, slots());
        const Index first = numbering_.first_leaf[first_slot], end = numbering_.first_leaf[end_slot];
        const auto is_own = [&](Index leaf) { return leaf >= first && leaf < end; };
        const auto triangles =
            std::span(triangles_).subspan(first_triangle_[part], first_triangle_[part + 1] - first_triangle_[part]);

        std::vector<Index>& ghosts = out.ghost_leaves;
        for (const Index t : triangles)
            for (const Index leaf : input_.leaves.triangles[t])
                if (!is_own(numbering_.number[leaf])) ghosts.push_back(numbering_.number[leaf]);
        std::sort(ghosts.begin(), ghosts.end());
        ghosts.erase(std::unique(ghosts.begin(), ghosts.end()), ghosts.end());

        out.first_slot = first_slot, out.own_slots = end_slot - first_slot;
        out.first_leaf = first, out.own_leaves = end - first;
        out.area_scale = area_scale_;
        out.classes = classes_;
        out.normal_class = 0;
        out.uv_class = texture_unit_ > 0 ? 1 : most_classes;
        out.normal_scale = static_cast<float>(normal_scale);
        push_leaves(first_slot, out);
        out.triangles.reserve(triangles.size());
        for (const Index t : triangles) {
            Triangle local = input_.leaves.triangles[t];
            for (Index& leaf : local) {
                const Index number = numbering_.number[leaf];
                leaf = is_own(number) ? number - first
                                      : end - first +
                                            static_cast<Index>(std::lower_bound(ghosts.begin(), ghosts.end(), number) -
                                                               ghosts.begin());
            }
            out.triangles.push_back(local);
        }
        return out;
    }

    glm::dvec3 from_unit_box(glm::dvec3 p) const { return p / scale_ + centre_; }
    float length_from_unit_box(float length) const { return static_cast<float>(length / scale_); }

private:
    void measure() {
        const Box box = box_around(input_.mesh.positions);
        const double extent = box.extent();
        centre_ = box.low + box.size() * 0.5;
        scale_ = extent > 0 && std::isfinite(1 / extent) ? 1 / extent : 1;
        double largest = 0;
        for (const double a : input_.areas) largest = std::max(largest, a);
        largest *= scale_ * scale_;
        area_scale_ = largest > 0 && std::isfinite(1 / largest) ? 1 / largest : 1;
        if (!input_.leaves.uvs.empty())
            texture_unit_ =
                texture_scale * texture_density(input_.leaves.triangles, input_.leaves.uvs, [&](Index leaf) {
                    return input_.mesh.positions[input_.leaves.places[leaf]] * scale_;
                });
        classes_.channels[classes_.count++] = 3;
        if (texture_unit_ > 0) classes_.channels[classes_.count++] = 2;
        if (!input_.leaves.colours.empty()) classes_.channels[classes_.count++] = 4;
    }

    // The own ones, then the ghosts, each with its slot.
    void push_leaves(Index first_slot, PartMesh& out) const {
        const std::size_t leaves = out.own_leaves + out.ghost_leaves.size();
        out.channel_values.reserve(leaves * classes_.total_channels());
        out.slot_of_leaf.reserve(leaves);
        out.positions.reserve(out.own_slots + out.ghost_leaves.size());
        const auto push_position = [&](Index slot) {
            out.positions.push_back((input_.mesh.positions[numbering_.place_of_slot[slot]] - centre_) * scale_);
        };
        const auto push_leaf = [&](Index number) {
            const Index leaf = numbering_.leaves[number];
            out.slot_of_leaf.push_back(static_cast<Index>(out.positions.size() - 1));
            push_channels(leaf, out.channel_values);
            if (!input_.leaves.materials.empty()) out.materials.push_back(input_.leaves.materials[leaf]);
        };
        for (Index s = first_slot; s < first_slot + out.own_slots; ++s) {
            push_position(s);
            if (!input_.weights.empty()) out.weights.push_back(input_.weights[numbering_.place_of_slot[s]]);
            for (Index i = numbering_.first_leaf[s]; i < numbering_.first_leaf[s + 1]; ++i) push_leaf(i);
        }
        Index last_slot = static_cast<Index>(input_.mesh.positions.size());
        for (const Index number : out.ghost_leaves) {
            const Index slot = static_cast<Index>(
                std::upper_bound(numbering_.first_leaf.begin(), numbering_.first_leaf.end(), number) -
                numbering_.first_leaf.begin() - 1);
            if (slot != std::exchange(last_slot, slot)) push_position(slot);
            push_leaf(number);
        }
    }

    void list_triangles() {
        const std::size_t count = input_.mesh.triangles.size(), parts = numbering_.parts;
        first_triangle_.assign(parts + 1, 0);
        std::vector<Index> part_of(input_.mesh.positions.size(), static_cast<Index>(parts));
        parallel_loop(std::size_t{0}, parts, [&](std::size_t part) {
            const Index end = part_begin(part + 1, parts, slots());
            for (Index s = part_begin(part, parts, slots()); s < end; ++s)
                part_of[numbering_.place_of_slot[s]] = static_cast<Index>(part);
        });
        const auto for_each_use = [&](auto&& f) {
            for (std::size_t t = 0; t < count; ++t) {
                const Triangle& tri = input_.mesh.triangles[t];
                const Index a = part_of[tri[0]], b = part_of[tri[1]], c = part_of[tri[2]];
                if (a < parts) f(t, a);
                if (b != a && b < parts) f(t, b);
                if (c != a && c != b && c < parts) f(t, c);
            }
        };
        for_each_use([&](std::size_t, Index part) { ++first_triangle_[part + 1]; });
        std::partial_sum(first_triangle_.begin(), first_triangle_.end(), first_triangle_.begin());
        triangles_.resize(first_triangle_.back());
        std::vector<std::size_t> next(first_triangle_);
        for_each_use([&](std::size_t t, Index part) { triangles_[next[part]++] = static_cast<Index>(t); });
    }

    void push_channels(Index leaf, std::vector<float>& to) const {
        const LeafView& leaves = input_.leaves;
        const auto push = [&](double value) {
            to.push_back(static_cast<float>(std::clamp(value, -largest_value, largest_value)));
        };
        for (int k = 0; k < 3; ++k) push(leaves.normals[leaf][k] * normal_scale);
        if (texture_unit_ > 0)
            for (int k = 0; k < 2; ++k) push(leaves.uvs[leaf][k] * texture_unit_);
        if (leaves.colours.empty()) return; // luminance is the normal's then
        push(leaves.luminance[leaf] * luminance_scale);
        for (int k = 0; k < 3; ++k) push(leaves.colours[leaf][k] * colour_scale);
    }

    std::size_t slots() const { return numbering_.folding; }

    const ClusterInput& input_;
    const SpatialNumbering& numbering_;
    glm::dvec3 centre_{0};
    double scale_ = 1;        // mesh units to the unit box
    double area_scale_ = 1;   // areas in the unit box to shares of the largest
    double texture_unit_ = 0; // length in the unit box that one unit of texture coordinates counts as
    AttributeClasses classes_;
    std::vector<std::size_t> first_triangle_; // by part, one longer
    std::vector<Index> triangles_;            // those that touch a place of the part, by part
};

// ---- the whole

// A contraction's record, or everything else of it, for a MessageWriter or a MessageReader.
template <class Record, class Message>
void exchange_record(Record& r, Message& message) {
    message(r.merges), message(r.round_ends), message(r.vanishings);
}

template <class Joinable, class Message>
void exchange_joinable(Joinable& c, Message& message) {
    message(c.first_slot), message(c.end_slot), message(c.first_leaf), message(c.end_leaf);
    message(c.classes.count);
    for (auto& channels : c.classes.channels) message(channels);
    message(c.live.clusters), message(c.live.places), message(c.live.references), message(c.live.quadrics);
    message(c.live.several), message(c.live.components);
    message(c.triangles), message(c.outside);
    message(c.pairs), message(c.links_of_pairs), message(c.links), message(c.outer_edges), message(c.border_leaves);
}

// The merges of all parts; first those of the parts themselves, then those of joined pairs of parts, and so on.
using Level = std::vector<MergeRecord>;

// Contracts the parts and joins them up the kd-tree, in one process or with a team. Each member has a run of parts;
// what is joined belongs to the member that has its first part. Messages go to lower ranks only, those of a level are
// sent before any are waited for, and so nobody waits in a circle.
class PartContractor {
public:
    PartContractor(const PartMaker& maker, const Members& members, ProgressCounter& counter)
        : maker_(maker), members_(members), parts_(members.parts), rank_(members.rank()), counter_(counter) {}

    // Member 0 returns all merges; the others' levels hold only their own, which have been sent.
    Result<std::vector<Level>> run() {
        std::vector<Contraction> current;
        for (std::size_t count = parts_; count > 0; count /= 2) {
            if (const auto ok = gather_neighbours(current, count); !ok) return ok.error();
            current = work_on_level(std::move(current), count);
            if (counter_.stopped()) return Error{ErrorCode::cancelled, "Clustering was cancelled."};
        }
        if (const auto ok = gather_records(); !ok) return ok.error();
        if (rank_ == 0) finish(current[0]);
        return std::move(levels_);
    }

private:
    std::size_t owner(std::size_t i, std::size_t count) const { return members_.owner(i, count); }
    bool is_ours(std::size_t i, std::size_t count) const { return owner(i, count) == rank_; }

    std::vector<Contraction> work_on_level(std::vector<Contraction> current, std::size_t count) {
        const auto after_round = [&](std::size_t merges) { return counter_.add(merges); };
        const Index target = count == 1 ? 1 : part_target;
        Level& level = levels_.emplace_back(count);
        std::vector<Contraction> next(count);
        parallel_loop_over(
            tbb::blocked_range<std::size_t>(0, count, 1),
            [&](const tbb::blocked_range<std::size_t>& range) {
                for (std::size_t i = range.begin(); i < range.end(); ++i) {
                    if (counter_.stopped()) return;
                    if (!is_ours(i, count)) continue;
                    if (count == parts_) {
                        next[i] = contract_part(maker_.make(i), target, after_round);
                    } else {
                        next[i] = join(current[2 * i], current[2 * i + 1], target, after_round);
                        current[2 * i] = current[2 * i + 1] = {};
                    }
                    level[i] = std::exchange(next[i].record, {});
                }
            },
            tbb::simple_partitioner());
        return next;
    }

    // Before a level is worked on: the right halves go to the members that have the left ones.
    Result<void> gather_neighbours(std::vector<Contraction>& halves, std::size_t count) {
        if (members_.count() == 1 || count == parts_) return {};
        for (std::size_t i = 0; i < count; ++i) {
            if (is_ours(i, count) || !is_ours(2 * i + 1, 2 * count)) continue;
            MessageWriter message;
            exchange_joinable(std::as_const(halves[2 * i + 1]), message);
            members_.team->send(static_cast<int>(owner(i, count)), message.bytes());
            halves[2 * i + 1] = {};
        }
        for (std::size_t i = 0; i < count; ++i) {
            if (!is_ours(i, count) || is_ours(2 * i + 1, 2 * count)) continue;
            const std::vector<std::byte> bytes = members_.team->receive(static_cast<int>(owner(2 * i + 1, 2 * count)));
            MessageReader message(bytes);
            exchange_joinable(halves[2 * i + 1], message);
            if (!message.complete() || halves[2 * i + 1].first_slot != halves[2 * i].end_slot) return strange_message();
        }
        return {};
    }

    Result<void> gather_records() {
        if (members_.count() == 1) return {};
        for (Level& level : levels_) {
            for (std::size_t i = 0; i < level.size(); ++i) {
                const std::size_t from = owner(i, level.size());
                if (rank_ != 0 && from == rank_) {
                    MessageWriter message;
                    exchange_record(std::as_const(level[i]), message);
                    members_.team->send(0, message.bytes());
                    level[i] = {};
                } else if (rank_ == 0 && from != 0) {
                    const std::vector<std::byte> bytes = members_.team->receive(static_cast<int>(from));
                    MessageReader message(bytes);
                    exchange_record(level[i], message);
                    if (!message.complete()) return strange_message();
                }
            }
        }
        return {};
    }

    // Without the last triangles nothing is left of the model: that strays as far as it is large.
    void finish(const Contraction& whole) {
        constexpr float whole_extent = 1;
        const Index last = whole.live[0].vanishing;
        if (last != no_merge) levels_.back()[0].vanishings.push_back({last, whole_extent});
    }

    const PartMaker& maker_;
    const Members members_;
    std::size_t parts_, rank_;
    ProgressCounter& counter_;
    std::vector<Level> levels_;
};

// Numbers the clusters: places, then the merges round by round, all parts side by side.
class ClusteringWriter {
public:
    ClusteringWriter(const ClusterInput& input, const SpatialNumbering& numbering, const PartMaker& maker)
        : input_(input), numbering_(numbering), maker_(maker) {}

    Clustering write(std::vector<Level>& levels) {
        result_.parents.resize(places());
        cluster_ = numbering_.place_of_slot;
        made_by_joining_.resize(cluster_.size());
        for (Level& level : levels) {
            write_level(level);
            level = {};
        }
        const auto root = static_cast<Index>(result_.parents.size() - 1);
        result_.parents.back() = root;
        for (std::size_t s = numbering_.folding; s < places(); ++s) result_.parents[numbering_.place_of_slot[s]] = root;
        for (Index c = 0; c < result_.deviations.size(); ++c)
            raise(result_.parents[places() + c], result_.deviations[c]);
        return std::move(result_);
    }

private:
    // Round by round, and in a round record by record; records of one level have no place in common.
    void write_level(const Level& level) {
        std::size_t rounds = 0;
        for (const MergeRecord& record : level) rounds = std::max(rounds, record.round_ends.size());
        for (std::size_t round = 0; round < rounds; ++round)
            for (const auto& [merges, ends, vanishings] : level)
                if (round < ends.size())
                    for (Index i = round == 0 ? 0 : ends[round - 1]; i < ends[round]; ++i) write(merges[i]);
        for (const MergeRecord& record : level)
            for (const auto& vanishing : record.vanishings)
                raise(made_by_joining_[vanishing.joined], maker_.length_from_unit_box(vanishing.deviation));
    }

    void write(const Merge& merge) {
        const glm::dvec3 place = snapped(maker_.from_unit_box(merge.place), position(cluster_[merge.kept]),
                                         position(cluster_[merge.joined]));
        const Index parent = make_cluster(place);
        result_.deviations.back() = maker_.length_from_unit_box(merge.deviation);
        result_.parents[cluster_[merge.kept]] = result_.parents[cluster_[merge.joined]] = parent;
        cluster_[merge.kept] = made_by_joining_[merge.joined] = parent;
    }

    glm::dvec3 position(Index cluster) const {
        return cluster < places() ? input_.mesh.positions[cluster] : result_.positions[cluster - places()];
    }

    // Floats place a proxy to a millionth of the way between its parts. Where it has a coordinate of one of them but for
    // that, it has it exactly: so what folds in a plane along the axes, or at its border, stays there.
    static glm::dvec3 snapped(glm::dvec3 at, const glm::dvec3& a, const glm::dvec3& b) {
        constexpr double near_enough = 1e-5; // share of the distance between the parts
        const double reach = near_enough * glm::distance(a, b);
        for (int axis = 0; axis < 3; ++axis) {
            if (std::abs(at[axis] - a[axis]) <= reach) at[axis] = a[axis];
            else if (std::abs(at[axis] - b[axis]) <= reach) at[axis] = b[axis];
        }
        return at;
    }

    Index make_cluster(glm::dvec3 position) {
        const Index number = static_cast<Index>(result_.parents.size());
        result_.parents.push_back(number);
        result_.positions.push_back(position);
        result_.deviations.push_back(0);
        return number;
    }

    void raise(Index cluster, float deviation) {
        float& here = result_.deviations[cluster - places()];
        here = std::max(here, deviation);
    }
    Index places() const { return static_cast<Index>(input_.mesh.positions.size()); }

    const ClusterInput& input_;
    const SpatialNumbering& numbering_;
    const PartMaker& maker_;
    Clustering result_;
    std::vector<Index> cluster_;         // by slot: the cluster that is known under its name
    std::vector<Index> made_by_joining_; // by slot: the cluster made when the one of this name was joined to another
};

} // namespace

Result<Clustering> cluster_quadric(const ClusterInput& input, const Progress& progress, Team* team) {
    const std::size_t slots = folding_places(input);
    const Members members{team, part_count(slots)};
    if (!members.has_part()) return Clustering();
    ProgressCounter counter(progress, (slots - 1) / members.count()); // each counts its own merges
    if (!counter.add(0)) return Error{ErrorCode::cancelled, "Clustering was cancelled."};
    const auto numbering = number_by_space(input, members);
    if (!numbering) return numbering.error();
    const PartMaker maker(input, *numbering);
    auto levels = PartContractor(maker, members, counter).run();
    if (!levels) return levels.error();
    if (members.rank() != 0) return Clustering();
    return ClusteringWriter(input, *numbering, maker).write(*levels);
}

} // namespace unseen::vdtree
