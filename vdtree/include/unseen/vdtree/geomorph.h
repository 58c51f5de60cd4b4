// Geomorphs: vertices glide between a proxy and its children over a set time, so that a cut changes without popping.
//
// A geomorph keeps a second cut, the *drawn* one, behind a followed cut. Unfolds are made in it at once, and the children
// glide from their proxy's place to their own; for folds, the children glide to the proxy first. A change that is reverted
// meanwhile turns them around. Every changing node has a weight w from 0 (folded) to 1 (unfolded), and a child is drawn at
//     (1 - w) * place(node) + w * own place,
// where the node itself may be gliding, too. So every point of the drawn surface moves continuously. Once the followed cut
// has stood still for a glide's time, both cuts are equal.
//
// The drawn cut is always a valid cut, without cracks. It has the triangles of the followed cut, and those that folds have
// removed within a glide's time: a triangle budget holds for the followed cut only.
#pragma once

#include <unseen/vdtree/cut.h>

namespace unseen::vdtree {

// A gliding vertex: values to draw in place of the tree's own.
struct MovedVertex {
    WedgeId wedge = 0;
    glm::vec3 position = glm::vec3(0); // relative to the tree's origin, mesh units
    float luminance = 0;               // relative, linear
    glm::vec4 colour = glm::vec4(0);   // linear; 0 where the tree has no colours
};

// Used from one thread at a time. Move-only. The drawn cut depends on the sequence of cuts and time steps alone. Memory: a
// cut, 4 bytes an interior node, and about 200 bytes a gliding vertex.
class Geomorph {
public:
    Geomorph(Geomorph&&) noexcept;
    Geomorph& operator=(Geomorph&&) noexcept;
    ~Geomorph();

    // `seconds`: a glide's time; 0: the drawn cut is the followed one. A step is a jump if it is the first, or if more than
    // `jump_share` of the triangles come or go by more than 64 folds and unfolds. A jump ends all glides: the drawn cut
    // becomes the followed one. Keeps the tree's data. Fails if an argument is negative or NaN, or the time is infinite.
    static Result<Geomorph> create(const VertexTree& tree, double seconds = 0.25, double jump_share = 0.25);

    // Advances the glides by `seconds`, then takes up the followed cut's changes since the last step. Fails, and changes
    // nothing, if the time is negative or not finite, or the cut is of another tree. Cost: that of the changes and of the
    // gliding vertices, and one bit a node of the tree if the cut was changed more than once, or by hand.
    Result<void> step(const Cut& cut, double seconds);

    const Cut& drawn() const noexcept;

    // The vertices of the drawn cut that may be away from their own places, each once.
    std::span<const MovedVertex> moved() const noexcept;
    bool is_gliding() const noexcept; // false: steps do nothing until the followed cut changes

    double seconds() const noexcept;
    std::uint64_t byte_size() const noexcept; // the drawn cut's included

private:
    struct State;
    explicit Geomorph(std::unique_ptr<State> state) noexcept;

    std::unique_ptr<State> state_;
};

} // namespace unseen::vdtree
