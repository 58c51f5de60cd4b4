#include <unseen/vdtree/geomorph.h>

#include <unseen/vdtree/internal/errors.h>

#include <glm/common.hpp>

#include "cut/cut_state.h"

namespace unseen::vdtree {

namespace {

// So few changes are no jump, whatever their share of the triangles: coarse cuts change by large steps.
constexpr std::size_t fewest_of_a_jump = 64;

// As a share of a glide: so near its end it is there. Sums of time steps that make up its time come this near.
constexpr double arrived = 1e-9;

MovedVertex at_rest(const VertexTree& tree, WedgeId wedge) {
    return {wedge, tree.positions()[wedge], tree.luminance()[wedge],
            tree.colours().empty() ? glm::vec4(0) : tree.colours()[wedge]};
}

MovedVertex between(const MovedVertex& proxy, const MovedVertex& own, float share) {
    return {own.wedge, glm::mix(proxy.position, own.position, share), glm::mix(proxy.luminance, own.luminance, share),
            glm::mix(proxy.colour, own.colour, share)};
}

} // namespace

struct Geomorph::State {
    using Slot = std::uint32_t;
    static constexpr Slot no_slot = 0xffffffffu;

    // A node of the drawn cut whose children are on their way. What frames read of the tree is kept here, side by side.
    struct Glide {
        double weight = 0; // 0: the children are at the proxy, 1: at their own places
        bool unfolds = true;
        NodeId node = no_node, parent = no_node;
        std::vector<MovedVertex> own;   // the node's wedges, in their own place
        std::vector<MovedVertex> drawn; // where they would be drawn, as of the step `placed`
        std::uint64_t placed = 0;
        struct Child {
            NodeId node;
            std::size_t above; // which of the node's wedges holds it
            MovedVertex own;
        };
        std::vector<Child> children; // wedges of the node's children, in their own places
    };

    State(const VertexTree& tree, double seconds, double jump_share)
        : glide_s(seconds), jump_share(jump_share), drawn_cut(tree), drawn(CutState::of(drawn_cut)) {}

    void step(const CutState& cut, double seconds) {
        const bool is_first = revision == 0;
        const auto changes = changes_of(cut);
        revision = cut.revision();
        if (is_first || is_jump(cut, changes)) {
            become(cut);
            return;
        }
        AdjustStats unused;
        drawn.begin_changes();
        pass(seconds);
        take_up(cut, changes);
        end_glides();
        drawn.end_changes(unused);
        move_vertices();
    }

    // What leads from the cut at the last step, or from the drawn one, to this cut; parents unfold before their children.
    std::span<const FoldChange> changes_of(const CutState& cut) {
        if (cut.revision() == revision) return {};
        if (cut.changes_from() == revision) return cut.changes();
        found.clear();
        for (std::size_t word = 0; word < cut.unfolded().size(); ++word)
            for_each_bit(cut.unfolded()[word] ^ drawn.unfolded()[word], 64 * word, [&](NodeId node) {
                found.push_back({node, drawn.is_unfolded_interior(node)});
            });
        return found;
    }

    bool is_jump(const CutState& cut, std::span<const FoldChange> changes) const {
        if (changes.size() <= fewest_of_a_jump) return false;
        std::uint64_t triangles = 0;
        for (const FoldChange& change : changes) triangles += unchecked_links(cut.tree()).triangles_of(change.node);
        const double shown = std::max(cut.triangle_count(), drawn.triangle_count());
        return static_cast<double>(triangles) > jump_share * shown;
    }

    void become(const CutState& cut) {
        for (const Glide& glide : glides) slot_of_node[glide.node] = no_slot;
        glides.clear();
        moved.clear();
        AdjustStats unused;
        drawn.show({cut.unfolded().begin(), cut.unfolded().end()}, unused);
    }

    void pass(double seconds) {
        if (glides.empty()) return;
        const double share = seconds < glide_s ? seconds / glide_s : 1;
        for (Glide& glide : glides)
            glide.weight = glide.unfolds ? std::min(glide.weight + share, 1.0) : std::max(glide.weight - share, 0.0);
    }

    // A node may have changed more than once: only what it is now counts.
    void take_up(const CutState& cut, std::span<const FoldChange> changes) {
        for (const auto [node, folded] : changes) {
            const bool is_drawn_unfolded = drawn.is_unfolded_interior(node);
            if (cut.is_unfolded_interior(node)) {
                if (is_drawn_unfolded) continue;
                drawn.apply_unfold(node);
                begin(node, 0);
            } else if (is_drawn_unfolded && !is_gliding(node)) {
                begin(node, 1);
            }
        }
        for (Glide& glide : glides) glide.unfolds = cut.is_unfolded_interior(glide.node);
    }

    // A child never has more of its way left to the proxy than its parent, for it folds no later and unfolds no sooner;
    // where rounding says otherwise, the parent waits for it.
    void end_glides() {
        arrived_nodes.clear();
        const bool at_once = !(glide_s > 0);
        for (const Glide& glide : glides)
            if (at_once || (glide.unfolds ? glide.weight >= 1 - arrived : glide.weight <= arrived))
                arrived_nodes.push_back(glide.node);
        std::sort(arrived_nodes.begin(), arrived_nodes.end(), std::greater<>()); // children first
        for (const NodeId node : arrived_nodes) {
            if (!glides[slot_of_node[node]].unfolds) {
                bool is_flat = true;
                for (const Glide::Child& child : glides[slot_of_node[node]].children)
                    is_flat &= !drawn.is_unfolded(child.node);
                if (!is_flat) continue;
                drawn.apply_fold(node);
            }
            end(node);
        }
    }

    void move_vertices() {
        moved.clear();
        ++steps;
        for (Slot slot = 0; slot < glides.size(); ++slot) {
            place(slot);
            const Glide& glide = glides[slot];
            const float share = static_cast<float>(glide.weight);
            for (const Glide::Child& child : glide.children) // those of an unfolded node are active, or unfolded, too
                if (!drawn.is_unfolded(child.node))
                    moved.push_back(between(glide.drawn[child.above], child.own, share));
        }
    }

    // Finds out where a gliding node's vertex would be drawn, and those above it as far as they glide, once a step. Without
    // recursion, for trees may be as deep as they have vertices.
    void place(Slot slot) {
        unplaced.clear();
        for (; slot != no_slot && glides[slot].placed != steps; slot = slot_of(glides[slot].parent))
            unplaced.push_back(slot);
        for (; !unplaced.empty(); unplaced.pop_back()) {
            Glide& glide = glides[unplaced.back()];
            const Slot parent = slot_of(glide.parent);
            glide.placed = steps;
            glide.drawn = glide.own;
            if (parent == no_slot) continue;
            const Glide& above = glides[parent];
            for (MovedVertex& vertex : glide.drawn)
                vertex =
                    between(above.drawn[place_in(above.node, vertex.wedge)], vertex, static_cast<float>(above.weight));
        }
    }

    void begin(NodeId node, double weight) {
        const VertexTree& tree = drawn.tree();
        if (slot_of_node.empty()) slot_of_node.assign(tree.interior_count(), no_slot);
        slot_of_node[node] = static_cast<Slot>(glides.size());
        Glide glide{weight, weight == 0, node, unchecked_links(tree).parents[node], {}, {}, 0, {}};
        for (WedgeId w = tree.first_wedge(node); w < tree.wedge_end(node); ++w) glide.own.push_back(at_rest(tree, w));
        tree.for_each_child(node, [&](NodeId child) {
            for (WedgeId w = tree.first_wedge(child); w < tree.wedge_end(child); ++w)
                glide.children.push_back({child, place_in(node, w), at_rest(tree, w)});
        });
        glides.push_back(std::move(glide));
    }

    // Which of a node's wedges holds a wedge below.
    std::size_t place_in(NodeId node, WedgeId below) const {
        return drawn.tree().wedge_above(node, below) - drawn.tree().first_wedge(node);
    }

    void end(NodeId node) {
        const Slot slot = slot_of_node[node];
        slot_of_node[node] = no_slot;
        if (slot + 1 < glides.size()) {
            glides[slot] = std::move(glides.back());
            slot_of_node[glides[slot].node] = slot;
        }
        glides.pop_back();
    }

    std::uint64_t byte_size() const noexcept {
        std::uint64_t children = 0;
        for (const Glide& glide : glides)
            children += glide.children.capacity() + glide.own.capacity() + glide.drawn.capacity();
        return drawn.byte_size() + sizeof(Glide) * glides.capacity() + sizeof(MovedVertex) * children +
               sizeof(Slot) * slot_of_node.capacity() + sizeof(MovedVertex) * moved.capacity() +
               sizeof(FoldChange) * found.capacity() + sizeof(NodeId) * arrived_nodes.capacity() +
               sizeof(Slot) * unplaced.capacity();
    }

    Slot slot_of(NodeId node) const { return slot_of_node.empty() || node == no_node ? no_slot : slot_of_node[node]; }
    bool is_gliding(NodeId node) const { return slot_of(node) != no_slot; }

    double glide_s, jump_share;
    Cut drawn_cut;
    CutState& drawn;            // of that cut
    std::uint64_t revision = 0; // of the followed cut, when it was last taken up
    std::uint64_t steps = 0;
    std::vector<Glide> glides;
    std::vector<Slot> slot_of_node; // of a node's glide; made when the first one begins
    std::vector<MovedVertex> moved;
    std::vector<FoldChange> found; // scratch, as the following
    std::vector<NodeId> arrived_nodes;
    std::vector<Slot> unplaced;
};

Geomorph::Geomorph(std::unique_ptr<State> state) noexcept : state_(std::move(state)) {}
Geomorph::Geomorph(Geomorph&&) noexcept = default;
Geomorph& Geomorph::operator=(Geomorph&&) noexcept = default;
Geomorph::~Geomorph() = default;

const Cut& Geomorph::drawn() const noexcept { return state_->drawn_cut; }
std::span<const MovedVertex> Geomorph::moved() const noexcept { return state_->moved; }
bool Geomorph::is_gliding() const noexcept { return !state_->glides.empty(); }
double Geomorph::seconds() const noexcept { return state_->glide_s; }
std::uint64_t Geomorph::byte_size() const noexcept { return state_->byte_size(); }

Result<Geomorph> Geomorph::create(const VertexTree& tree, double seconds, double jump_share) {
    if (!(seconds >= 0) || !std::isfinite(seconds))
        return invalid_argument("The time of a geomorph must be 0 or more seconds, and finite.");
    if (!(jump_share >= 0)) return invalid_argument("The share of triangles that makes a jump must be 0 or more.");
    return Geomorph(std::make_unique<State>(tree, seconds, jump_share));
}

Result<void> Geomorph::step(const Cut& cut, double seconds) {
    if (!(seconds >= 0) || !std::isfinite(seconds))
        return invalid_argument("A geomorph's time step must be 0 or more seconds, and finite.");
    if (std::addressof(cut.tree().data()) != std::addressof(state_->drawn_cut.tree().data()))
        return invalid_argument("The cut belongs to another tree than the geomorph's; make a geomorph for that tree.");
    state_->step(CutState::of(cut), seconds);
    return {};
}

} // namespace unseen::vdtree
