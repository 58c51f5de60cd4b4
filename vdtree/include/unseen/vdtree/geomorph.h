// Geomorphs: vertices glide between a proxy and its children over a set time, so that a cut changes without popping.
//
// A geomorph keeps a second cut, the *drawn* one, behind a followed cut. What the followed cut unfolds is unfolded in
// the drawn one at once, and the children glide from where their proxy is drawn to their own places. What it folds
// stays unfolded in the drawn cut until the children have come to the proxy, then it is folded. A change that is taken
// back meanwhile turns the children around where they are. Every node that changes has a weight w, which runs from 0 to
// 1 while it unfolds and back while it folds, and a child is drawn at
//     (1 - w) * place(node) + w * own place,
// where the node itself may be gliding, too. So every point of the drawn surface moves continuously: in a step by at
// most the share (time step / time of a glide) of the way between a child and its proxy, for each of the nodes above it
// that glide. When the followed cut has stood still for the time of a glide, the drawn one is the same and nothing is
// moved any more.
//
// The drawn cut is a valid cut at any time (closed upward, no cracks). Its triangles are those of the followed cut and
// those that this one's folds have taken away within the time of a glide: a triangle budget holds for the followed cut
// only.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

#include <unseen/vdtree/cut.h>

namespace unseen::vdtree {

struct GeomorphOptions {
    double seconds = 0.25; // that a glide takes; 0: none, the drawn cut is the followed one

    // A step is a jump where more than this share of the triangles come or go, by more than 64 folds and unfolds; so is
    // the first one. Then all glides are cut short: the drawn cut becomes the followed one. Infinite: only the first
    // step is.
    double jump_share = 0.25;
};

// What a vertex of the drawn cut is drawn with instead of the tree's own values.
struct MovedVertex {
    NodeId node = 0;
    glm::vec3 position = glm::vec3(0); // relative to the tree's origin, mesh units
    float luminance = 0;               // relative, linear
    glm::vec4 colour = glm::vec4(0);   // linear; 0 where the tree has no colours
};

// Not thread-safe. Move-only. What is drawn follows from the sequence of cuts and time steps alone. Memory: a cut, 4
// bytes an interior node, and about 200 bytes a gliding vertex.
class Geomorph {
public:
    Geomorph(Geomorph&&) noexcept;
    Geomorph& operator=(Geomorph&&) noexcept;
    ~Geomorph();

    // Keeps the tree's data. Fails where an option is negative or NaN, or the time infinite.
    static Result<Geomorph> create(const VertexTree& tree, const GeomorphOptions& options = {});

    // Lets `seconds` go by, then takes up what has changed of the followed cut since the last step; glides that begin
    // now have not moved yet. The cut is of the same tree and the same from step to step; another one is taken for a
    // change of it. Cost: that of the changes and of the vertices that glide; where the cut was changed more than once
    // since the last step, or else than by follow() and adjust(), also one bit a node of the tree. Fails, and changes
    // nothing, where the time is negative or not finite, or the tree another one.
    Result<void> step(const Cut& cut, double seconds);

    const Cut& drawn() const noexcept;

    // The vertices of the drawn cut that may not be in their own places, each once; all others are.
    std::span<const MovedVertex> moved() const noexcept;
    // False: steps do nothing until the followed cut changes.
    bool is_gliding() const noexcept;

    double seconds() const noexcept;
    std::uint64_t byte_size() const noexcept; // the drawn cut's included

private:
    struct State;
    explicit Geomorph(std::unique_ptr<State> state) noexcept;

    std::unique_ptr<State> state_;
};

} // namespace unseen::vdtree
