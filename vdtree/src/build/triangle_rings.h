// The triangles around each cluster, while clusters merge: whether a merge would turn one of them over.
#pragma once

#include <bit>

#include <glm/geometric.hpp>

#include "build/quadric_contraction.h"

namespace unseen::vdtree {

// Clusters are known by tags, which never change: first the live clusters, then the leaves outside.
class TriangleRings {
public:
    explicit TriangleRings(const Contraction& c);

    // From now on turns() can be asked. Before it clusters may unite, too, and cost less.
    void start();
    bool is_started() const { return !lists_.empty(); }

    // Whether a triangle of a or b turns by more than a merge may, or faces away from its original normal, if both go to
    // `place`.
    bool turns(Index a, Index b, glm::dvec3 place);
    // a's tag is the new cluster's.
    void unite(Index a, Index b, glm::dvec3 place);

    // Those that are left, by the clusters' numbers; leaves outside are numbered as before.
    std::vector<LiveTriangle> left(std::span<const Index> tag_of_cluster) const;

private:
    // With a list of the corners at each cluster: corner k of triangle t is number 4 t + k.
    struct Ring {
        std::array<Index, 3> corners, next;
        glm::vec3 normal;
    };
    struct List {
        Index first, last;
    };

    Index root_of(Index tag) const {
        while (joined_to_[tag] != tag) tag = joined_to_[tag];
        return tag;
    }
    // The same, and next time sooner.
    Index short_root_of(Index tag) {
        const Index up = joined_to_[tag];
        if (joined_to_[up] == up) return up;
        const Index root = root_of(up);
        return joined_to_[tag] = root;
    }
    Index tag_of(Index corner) const;
    bool turns_around(Index tag, Index other, glm::vec3 place);
    void append(Index tag, Index corner);

    glm::dvec3 centre_{0}; // of what places are relative to
    const Contraction& c_; // its triangles, until left() is asked for
    Index clusters_;
    std::vector<Ring> rings_;
    std::vector<List> lists_;       // by tag
    std::vector<Index> joined_to_;  // by tag
    std::vector<glm::vec3> places_; // by tag
};

} // namespace unseen::vdtree
