// Pair contraction by quadric error over position, luminance and the mesh's own attributes (Garland and Heckbert 1997,
// 1998).
//
// The welded vertices are parted by a kd-tree, each part is contracted by itself to a small share of its vertices, and
// the parts are joined up the kd-tree while contraction goes on (see quadric_contraction.h). The parts depend on the
// mesh alone, so the result does not depend on threads. Within a part, contraction runs in rounds: each cluster chooses
// its best partner, and pairs that choose each other are contracted. That is nearest-neighbour agglomeration: the
// hierarchy differs little from strictly greedy order, but the work is linear a round, cache-friendly, and the tree is
// balanced.
#include <unseen/vdtree/builder.h>

#include <numeric>

#include <glm/geometric.hpp>

#include <unseen/vdtree/internal/parallel.h>
#include <unseen/vdtree/internal/team.h>

#include "build/progress_counter.h"
#include "build/quadric.h"
#include "build/quadric_contraction.h"
#include "build/spatial_order.h"
#include "tree/message.h"

namespace unseen::vdtree {

namespace {

// The corners as vertices, some of which are at one place.
struct LeafInput {
    MeshView mesh;
    std::span<const float> luminance;
    std::span<const glm::vec3> normals;
    std::vector<double> areas;
    std::vector<Index> coincident; // the first leaf at the same place
    std::span<const Index> places;
    std::vector<glm::dvec3> positions;

    explicit LeafInput(const ClusterInput& input)
        : luminance(input.leaves.luminance), normals(input.leaves.normals), areas(input.leaves.places.size()),
          coincident(areas.size()), places(input.leaves.places), positions(areas.size()) {
        std::vector<Index> first(input.mesh.positions.size(), no_node), count(first.size(), 0);
        for (Index leaf = 0; leaf < places.size(); ++leaf) {
            Index& at = first[places[leaf]];
            if (at == no_node) at = leaf;
            ++count[places[leaf]];
            coincident[leaf] = at;
            positions[leaf] = input.mesh.positions[places[leaf]];
        }
        for (Index leaf = 0; leaf < places.size(); ++leaf)
            areas[leaf] = input.areas[places[leaf]] / count[places[leaf]];
        mesh = {.positions = positions,
                .triangles = input.leaves.triangles,
                .normals = input.leaves.has_own_normals ? normals : std::span<const glm::vec3>(),
                .colours = input.leaves.colours,
                .uvs = input.leaves.uvs};
    }
};

// Largest number of welded vertices in a part, so that its quadrics fit a core's cache.
constexpr Index largest_part = 1 << 15;
// Parts, and joined parts, are contracted to at most this many clusters: one in 32 of a full part. Few enough that
// joining costs next to nothing, many enough that those along the border of the part, which had fewer partners to
// choose from, are a small share.
constexpr Index part_target = largest_part / 32;

// One unit of relative luminance counts as this share of the model's extent. From 0.01 to 0.2, the triangles that the
// perceptual fold test leaves of bunny and dragon differ by 0.5%; but with 0.2 the surface strays 1.3 to 1.7 times as
// far for its triangles, for on a bumpy surface luminance then drowns the shape.
constexpr double luminance_scale = 0.01;
// A normal that turns by one radian, and a colour that goes from 0 to 1, count as these shares of the extent. Less than
// luminance, which is what is seen of both in most lights.
constexpr double normal_scale = 0.0025;
constexpr double colour_scale = 0.005;
// A texture that slides by a length on the surface counts as this share of the length: what one sees of it depends on
// the texture, and most of a displacement is seen whatever it is.
constexpr double texture_scale = 0.1;
// Attributes count as if they were within this many extents, so that stray values stay finite when squared.
constexpr double largest_value = 1e3;

// ---- numbering of the welded vertices by space

// The begin of part `part` of `parts`.
Index part_begin(std::size_t part, std::size_t parts, std::size_t slots) {
    return static_cast<Index>(static_cast<std::uint64_t>(part) * slots / parts);
}

// Welded vertices ("slots") in an order in which every part is a range, and the mesh's vertices in the order of their
// slots.
struct SpatialNumbering {
    std::size_t parts = 1;             // a power of two
    std::vector<Index> vertex_of_slot; // the first of its vertices
    std::vector<Index> first_member;   // by slot, one longer: into `members`
    std::vector<Index> members;        // vertices, by slot
    std::vector<Index> place;          // by vertex: where it is in `members`
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
Result<void> share_slots(std::vector<Index>& slots, const Members& members) {
    const auto own_slots = [&](std::size_t member) {
        const Index begin = part_begin(members.first_part(member), members.parts, slots.size());
        return std::span(slots).subspan(begin, part_begin(members.first_part(member + 1), members.parts, slots.size()) -
                                                   begin);
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
        members.team->send(static_cast<int>(member), std::as_bytes(std::span(slots)));
    return {};
}

// How many parts: a power of two.
std::size_t part_count(std::size_t slots) {
    std::size_t parts = 1;
    while (parts * largest_part < slots) parts *= 2;
    return parts;
}

std::size_t slot_count(std::span<const Index> coincident) {
    std::size_t slots = 0;
    for (std::size_t v = 0; v < coincident.size(); ++v) slots += coincident[v] == v;
    return slots;
}

Result<SpatialNumbering> number_by_space(std::span<const glm::dvec3> positions, std::span<const Index> coincident,
                                         const Members& members) {
    SpatialNumbering n;
    n.parts = members.parts;
    const Index vertices = static_cast<Index>(positions.size());
    for (Index v = 0; v < vertices; ++v)
        if (coincident[v] == v) n.vertex_of_slot.push_back(v);
    const std::size_t slots = n.vertex_of_slot.size();
    KdPartition(positions, n.vertex_of_slot, n.parts)
        .run(members.first_part(members.rank()), members.first_part(members.rank() + 1));
    if (members.count() > 1)
        if (const auto shared = share_slots(n.vertex_of_slot, members); !shared) return shared.error();

    n.first_member.assign(slots + 1, 0);
    n.place.resize(vertices);
    for (Index s = 0; s < slots; ++s) n.place[n.vertex_of_slot[s]] = s; // for now
    for (Index v = 0; v < vertices; ++v) ++n.first_member[n.place[coincident[v]] + 1];
    std::partial_sum(n.first_member.begin(), n.first_member.end(), n.first_member.begin());
    n.members.resize(vertices);
    std::vector<Index> next(n.first_member.begin(), n.first_member.end() - 1);
    for (Index v = 0; v < vertices; ++v) n.members[next[n.place[coincident[v]]]++] = v;
    for (Index i = 0; i < vertices; ++i) n.place[n.members[i]] = i;
    return n;
}

// ---- what the parts are made from

class PartMaker {
public:
    PartMaker(const LeafInput& input, const SpatialNumbering& numbering) : input_(input), numbering_(numbering) {
        measure();
        list_triangles();
    }

    PartMesh make(std::size_t part) const {
        PartMesh out;
        const Index first_slot = part_begin(part, numbering_.parts, slots()),
                    end_slot = part_begin(part + 1, numbering_.parts, slots());
        const Index first = numbering_.first_member[first_slot], end = numbering_.first_member[end_slot];
        const auto is_own = [&](Index place) { return place >= first && place < end; };
        const auto triangles =
            std::span(triangles_).subspan(first_triangle_[part], first_triangle_[part + 1] - first_triangle_[part]);

        std::vector<Index> ghosts; // places of other parts' vertices, by slot
        for (const Index t : triangles)
            for (const Index v : input_.mesh.triangles[t])
                if (!is_own(numbering_.place[v])) ghosts.push_back(numbering_.place[v]);
        std::sort(ghosts.begin(), ghosts.end());
        ghosts.erase(std::unique(ghosts.begin(), ghosts.end()), ghosts.end());

        out.first_slot = first_slot;
        out.own_slots = end_slot - first_slot;
        out.area_scale = area_scale_;
        out.channels = 1 + (has_normals_ ? 3 : 0) + (texture_unit_ > 0 ? 2 : 0) + (input_.mesh.colours.empty() ? 0 : 3);
        const std::size_t vertices = end - first + ghosts.size();
        out.channel_values.reserve(vertices * out.channels);
        out.slot_of_vertex.reserve(vertices);
        out.positions.reserve(out.own_slots + ghosts.size());
        const auto push_position = [&](Index slot) {
            out.positions.push_back((input_.mesh.positions[numbering_.vertex_of_slot[slot]] - centre_) * scale_);
        };
        for (Index s = first_slot; s < end_slot; ++s) {
            push_position(s);
            for (Index i = numbering_.first_member[s]; i < numbering_.first_member[s + 1]; ++i) {
                out.slot_of_vertex.push_back(s - first_slot);
                push_channels(numbering_.members[i], out.channel_values);
            }
        }
        for (const Index place : ghosts) {
            const Index slot = static_cast<Index>(
                std::upper_bound(numbering_.first_member.begin(), numbering_.first_member.end(), place) -
                numbering_.first_member.begin() - 1);
            if (out.ghost_slots.empty() || out.ghost_slots.back() != slot) {
                out.ghost_slots.push_back(slot);
                push_position(slot);
            }
            out.slot_of_vertex.push_back(static_cast<Index>(out.positions.size() - 1));
            push_channels(numbering_.members[place], out.channel_values);
        }
        out.triangles.reserve(triangles.size());
        for (const Index t : triangles) {
            Triangle local = input_.mesh.triangles[t];
            for (Index& v : local) {
                const Index place = numbering_.place[v];
                v = is_own(place) ? place - first
                                  : end - first +
                                        static_cast<Index>(std::lower_bound(ghosts.begin(), ghosts.end(), place) -
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
        has_normals_ = !input_.mesh.normals.empty();
        texture_unit_ = texture_density() * texture_scale;
    }

    // The length in the unit box that one unit of texture coordinates covers, on average; 0 without any.
    double texture_density() const {
        if (input_.mesh.uvs.empty()) return 0;
        double surface = 0, texture = 0;
        for (const Triangle& t : input_.mesh.triangles) {
            const auto p = [&](std::size_t k) { return input_.mesh.positions[t[k]] * scale_; };
            const auto uv = [&](std::size_t k) { return glm::dvec2(input_.mesh.uvs[t[k]]); };
            surface += glm::length(glm::cross(p(1) - p(0), p(2) - p(0)));
            const glm::dvec2 e = uv(1) - uv(0), f = uv(2) - uv(0);
            texture += std::abs(e.x * f.y - e.y * f.x);
        }
        const double density = std::sqrt(surface / texture);
        return density > 0 && std::isfinite(density) ? density : 0;
    }

    void list_triangles() {
        const std::size_t count = input_.mesh.triangles.size(), parts = numbering_.parts;
        first_triangle_.assign(parts + 1, 0);
        std::vector<Index> part_of(input_.mesh.positions.size());
        parallel_loop(std::size_t{0}, parts, [&](std::size_t part) {
            for (Index i = first_place(part); i < first_place(part + 1); ++i)
                part_of[numbering_.members[i]] = static_cast<Index>(part);
        });
        const auto for_each_use = [&](auto&& f) {
            for (std::size_t t = 0; t < count; ++t) {
                const Triangle& tri = input_.mesh.triangles[t];
                const Index a = part_of[tri[0]], b = part_of[tri[1]], c = part_of[tri[2]];
                f(t, a);
                if (b != a) f(t, b);
                if (c != a && c != b) f(t, c);
            }
        };
        for_each_use([&](std::size_t, Index part) { ++first_triangle_[part + 1]; });
        std::partial_sum(first_triangle_.begin(), first_triangle_.end(), first_triangle_.begin());
        triangles_.resize(first_triangle_.back());
        std::vector<std::size_t> next(first_triangle_);
        for_each_use([&](std::size_t t, Index part) { triangles_[next[part]++] = static_cast<Index>(t); });
    }

    void push_channels(Index v, std::vector<float>& to) const {
        const auto push = [&](double value) {
            to.push_back(static_cast<float>(std::clamp(value, -largest_value, largest_value)));
        };
        push(input_.luminance[v] * luminance_scale);
        if (has_normals_)
            for (int k = 0; k < 3; ++k) push(input_.normals[v][k] * normal_scale);
        if (texture_unit_ > 0)
            for (int k = 0; k < 2; ++k) push(input_.mesh.uvs[v][k] * texture_unit_);
        if (!input_.mesh.colours.empty())
            for (int k = 0; k < 3; ++k) push(input_.mesh.colours[v][k] * colour_scale);
    }

    std::size_t slots() const { return numbering_.vertex_of_slot.size(); }
    Index first_place(std::size_t part) const {
        return numbering_.first_member[part_begin(part, numbering_.parts, slots())];
    }

    const LeafInput& input_;
    const SpatialNumbering& numbering_;
    glm::dvec3 centre_{0};
    double scale_ = 1;      // mesh units to the unit box
    double area_scale_ = 1; // areas in the unit box to shares of the largest
    double texture_unit_ = 0;
    bool has_normals_ = false;
    std::vector<std::size_t> first_triangle_; // by part, one longer
    std::vector<Index> triangles_;            // those that touch a vertex of the part, by part
};

// ---- the whole

// A contraction's record, or everything else of it, for a MessageWriter or a MessageReader.
template <class Record, class Message>
void exchange_record(Record& r, Message& message) {
    message(r.merges), message(r.round_ends), message(r.vanishings);
}

template <class Joinable, class Message>
void exchange_joinable(Joinable& c, Message& message) {
    message(c.first_slot), message(c.end_slot), message(c.channels);
    message(c.live.clusters), message(c.live.places), message(c.live.references), message(c.live.quadrics);
    message(c.pairs), message(c.outer_edges), message(c.border_slots);
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

// Numbers the clusters: vertices, joined coincident vertices, then the merges round by round, all parts side by side.
class ClusteringWriter {
public:
    ClusteringWriter(const LeafInput& input, const SpatialNumbering& numbering, const PartMaker& maker)
        : input_(input), numbering_(numbering), maker_(maker) {}

    Clustering write(std::vector<Level>& levels) {
        begin();
        for (Level& level : levels) {
            write_level(level);
            level = {};
        }
        result_.parents.back() = static_cast<Index>(result_.parents.size() - 1);
        for (Index c = 0; c < result_.deviations.size(); ++c)
            raise(result_.parents[vertices() + c], result_.deviations[c]);
        return std::move(result_);
    }

private:
    // Round by round, and in a round record by record; records of one level have no vertex in common.
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
        const Index parent = make_cluster(maker_.from_unit_box(merge.place));
        result_.deviations.back() = maker_.length_from_unit_box(merge.deviation);
        result_.parents[cluster_[merge.kept]] = result_.parents[cluster_[merge.joined]] = parent;
        cluster_[merge.kept] = made_by_joining_[merge.joined] = parent;
    }

    Index make_cluster(glm::dvec3 position) {
        const Index number = static_cast<Index>(result_.parents.size());
        result_.parents.push_back(number);
        result_.positions.push_back(position);
        result_.deviations.push_back(0);
        return number;
    }

    void begin() {
        result_.parents.resize(vertices());
        cluster_.resize(vertices());
        for (Index s = 0; s < vertices(); ++s) cluster_[s] = input_.places[numbering_.vertex_of_slot[s]];
        made_by_joining_.resize(vertices());
    }

    void raise(Index cluster, float deviation) {
        float& here = result_.deviations[cluster - vertices()];
        here = std::max(here, deviation);
    }
    Index vertices() const { return static_cast<Index>(numbering_.vertex_of_slot.size()); }

    const LeafInput& input_;
    const SpatialNumbering& numbering_;
    const PartMaker& maker_;
    Clustering result_;
    std::vector<Index> cluster_;         // by slot: the cluster that is known under its name
    std::vector<Index> made_by_joining_; // by slot: the cluster made when the one of this name was joined to another
};

} // namespace

Result<Clustering> cluster_quadric(const ClusterInput& given, const Progress& progress, Team* team) {
    const LeafInput input(given);
    const std::size_t slots = slot_count(input.coincident);
    const Members members{team, part_count(slots)};
    if (!members.has_part()) return Clustering();
    ProgressCounter counter(progress, (slots - 1) / members.count()); // each counts its own merges
    if (!counter.add(0)) return Error{ErrorCode::cancelled, "Clustering was cancelled."};
    const auto numbering = number_by_space(input.mesh.positions, input.coincident, members);
    if (!numbering) return numbering.error();
    const PartMaker maker(input, *numbering);
    auto levels = PartContractor(maker, members, counter).run();
    if (!levels) return levels.error();
    if (members.rank() != 0) return Clustering();
    return ClusteringWriter(input, *numbering, maker).write(*levels);
}

} // namespace unseen::vdtree
