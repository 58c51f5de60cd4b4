#include <vdtree/geomorph.h>

#include "tree/unchecked_links.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>
#include <memory>
#include <utility>

#include <glm/common.hpp>

namespace unseen::vdtree {

namespace {

// So few changes are no jump, whatever their share of the triangles: coarse cuts change by large steps.
constexpr std::size_t fewest_of_a_jump = 64;

// As a share of a glide: so near its end it is there. Sums of time steps that make up its time come this near.
constexpr double arrived = 1e-9;

MovedVertex at_rest(const VertexTree& tree, NodeId node) {
    return {node, tree.positions()[node], tree.luminance()[node],
            tree.colours().empty() ? glm::vec4(0) : tree.colours()[node]};
}

MovedVertex between(const MovedVertex& proxy, const MovedVertex& own, float share) {
    return {own.node, glm::mix(proxy.position, own.position, share), glm::mix(proxy.luminance, own.luminance, share),
            glm::mix(proxy.colour, own.colour, share)};
}

Error invalid(const char* what) { return {ErrorCode::invalid_argument, what}; }

} // namespace

Result<Geomorph> Geomorph::create(const VertexTree& tree, const GeomorphOptions& options) {
    if (!(options.seconds >= 0) || !std::isfinite(options.seconds))
        return invalid("The time of a geomorph must be 0 or more seconds, and finite.");
    if (!(options.jump_share >= 0)) return invalid("The share of triangles that makes a jump must be 0 or more.");
    return Geomorph(tree, options);
}

Geomorph::Geomorph(const VertexTree& tree, const GeomorphOptions& options) : options_(options), drawn_(tree) {}

Result<void> Geomorph::step(const Cut& cut, double seconds) {
    if (!(seconds >= 0) || !std::isfinite(seconds))
        return invalid("A geomorph's time step must be 0 or more seconds, and finite.");
    if (std::addressof(cut.tree().data()) != std::addressof(drawn_.tree().data()))
        return invalid("The cut belongs to another tree than the geomorph's; make a geomorph for that tree.");
    const bool is_first = revision_ == 0;
    const auto changes = changes_of(cut);
    revision_ = cut.revision_;
    if (is_first || is_jump(cut, changes)) {
        become(cut);
        return {};
    }
    AdjustStats unused;
    drawn_.begin_changes();
    pass(seconds);
    take_up(cut, changes);
    end_glides();
    drawn_.end_changes(unused);
    move_vertices();
    return {};
}

// What leads from the cut at the last step, or from the drawn one, to this cut; parents unfold before their children.
std::span<const FoldChange> Geomorph::changes_of(const Cut& cut) {
    if (cut.revision_ == revision_) return {};
    if (cut.revision_ == revision_ + 1) return cut.changes_;
    changes_.clear();
    for (std::size_t word = 0; word < cut.unfolded_.size(); ++word) {
        for (std::uint64_t bits = cut.unfolded_[word] ^ drawn_.unfolded_[word]; bits; bits &= bits - 1) {
            const int bit = std::countr_zero(bits);
            const bool folded = (drawn_.unfolded_[word] >> bit) & 1;
            changes_.push_back({static_cast<NodeId>(word * 64 + static_cast<std::size_t>(bit)), folded});
        }
    }
    return changes_;
}

bool Geomorph::is_jump(const Cut& cut, std::span<const FoldChange> changes) const {
    if (changes.size() <= fewest_of_a_jump) return false;
    const auto first = unchecked_links(cut.tree()).first_triangle;
    std::uint64_t triangles = 0;
    for (const FoldChange& change : changes) triangles += first[change.node + 1] - first[change.node];
    const double shown = std::max(cut.triangle_count(), drawn_.triangle_count());
    return static_cast<double>(triangles) > options_.jump_share * shown;
}

void Geomorph::become(const Cut& cut) {
    for (const Glide& glide : glides_) slot_of_node_[glide.own.node] = no_slot;
    glides_.clear();
    moved_.clear();
    AdjustStats unused;
    drawn_.change_to(cut.unfolded_, unused);
}

void Geomorph::pass(double seconds) {
    if (glides_.empty()) return;
    const double share = seconds < options_.seconds ? seconds / options_.seconds : 1;
    for (Glide& glide : glides_)
        glide.weight = glide.unfolds ? std::min(glide.weight + share, 1.0) : std::max(glide.weight - share, 0.0);
}

// A node may have changed more than once: only what it is now counts.
void Geomorph::take_up(const Cut& cut, std::span<const FoldChange> changes) {
    for (const auto [node, folded] : changes) {
        const bool is_drawn_unfolded = drawn_.is_unfolded_interior(node);
        if (cut.is_unfolded_interior(node)) {
            if (is_drawn_unfolded) continue;
            drawn_.apply_unfold(node);
            begin(node, 0);
        } else if (is_drawn_unfolded && !is_gliding(node)) {
            begin(node, 1);
        }
    }
    for (Glide& glide : glides_) glide.unfolds = cut.is_unfolded_interior(glide.own.node);
}

// A child never has more of its way left to the proxy than its parent, for it folds no later and unfolds no sooner;
// where rounding says otherwise, the parent waits for it.
void Geomorph::end_glides() {
    arrived_.clear();
    const bool at_once = !(options_.seconds > 0);
    for (const Glide& glide : glides_)
        if (at_once || (glide.unfolds ? glide.weight >= 1 - arrived : glide.weight <= arrived))
            arrived_.push_back(glide.own.node);
    std::sort(arrived_.begin(), arrived_.end(), std::greater<>()); // children first
    for (const NodeId node : arrived_) {
        if (!glides_[slot_of_node_[node]].unfolds) {
            bool is_flat = true;
            for (const MovedVertex& child : glides_[slot_of_node_[node]].children)
                is_flat &= !drawn_.is_unfolded(child.node);
            if (!is_flat) continue;
            drawn_.apply_fold(node);
        }
        end(node);
    }
}

void Geomorph::move_vertices() {
    moved_.clear();
    ++steps_;
    for (Slot slot = 0; slot < glides_.size(); ++slot) {
        place(slot);
        const Glide& glide = glides_[slot];
        const float share = static_cast<float>(glide.weight);
        for (const MovedVertex& child : glide.children) // those of a node that is unfolded are active, or unfolded, too
            if (!drawn_.is_unfolded(child.node)) moved_.push_back(between(glide.drawn, child, share));
    }
}

// Finds out where a gliding node's vertex would be drawn, and those above it as far as they glide, once a step. Without
// recursion, for trees may be as deep as they have vertices.
void Geomorph::place(Slot slot) {
    unplaced_.clear();
    for (; slot != no_slot && glides_[slot].placed != steps_; slot = slot_of(glides_[slot].parent))
        unplaced_.push_back(slot);
    for (; !unplaced_.empty(); unplaced_.pop_back()) {
        Glide& glide = glides_[unplaced_.back()];
        const Slot parent = slot_of(glide.parent);
        glide.placed = steps_;
        glide.drawn = parent == no_slot
                          ? glide.own
                          : between(glides_[parent].drawn, glide.own, static_cast<float>(glides_[parent].weight));
    }
}

void Geomorph::begin(NodeId node, double weight) {
    const VertexTree& tree = drawn_.tree();
    if (slot_of_node_.empty()) slot_of_node_.assign(tree.interior_count(), no_slot);
    slot_of_node_[node] = static_cast<Slot>(glides_.size());
    glides_.push_back({weight, weight == 0, unchecked_links(tree).parents[node], at_rest(tree, node), {}, 0, {}});
    tree.for_each_child(node, [&](NodeId child) { glides_.back().children.push_back(at_rest(tree, child)); });
}

void Geomorph::end(NodeId node) {
    const Slot slot = slot_of_node_[node];
    slot_of_node_[node] = no_slot;
    if (slot + 1 < glides_.size()) {
        glides_[slot] = std::move(glides_.back());
        slot_of_node_[glides_[slot].own.node] = slot;
    }
    glides_.pop_back();
}

std::uint64_t Geomorph::byte_size() const noexcept {
    std::uint64_t children = 0;
    for (const Glide& glide : glides_) children += glide.children.capacity();
    return drawn_.byte_size() + sizeof(Glide) * glides_.capacity() + sizeof(MovedVertex) * children +
           sizeof(Slot) * slot_of_node_.capacity() +
           sizeof(MovedVertex) * moved_.capacity() + sizeof(FoldChange) * changes_.capacity() +
           sizeof(NodeId) * arrived_.capacity() + sizeof(Slot) * unplaced_.capacity();
}

} // namespace unseen::vdtree
