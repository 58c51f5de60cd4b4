// Discrete levels of detail of a vertex tree, evenly spaced in visibility: for renderers that choose among few meshes
// instead of cuts.
#pragma once

#include <unseen/session/request.h>
#include <unseen/vdtree/cut.h>

namespace unseen::session {

class Session;

constexpr int most_levels = 16;

struct LevelChainOptions {
    int levels = 6;                      // at most, 1 to most_levels; level 0 is the full mesh
    double most_share = 0.5;             // share of the triangles that level 1 keeps, above 0, at most 1
    double least_share = 0.01;           // share that the last level keeps, 0 to most_share
    vdtree::Index least_triangles = 100; // of the last level, even if that is more
};

// A value that shares the tree's data. Levels are the same from all sides: a level folds whatever a criterion calls
// invisible from a distance, in any direction. The distance grows by the same factor from level to level. Levels with
// as many triangles as the one before are left out, so small meshes have fewer.
class LevelChain {
public:
    // Uses the criterion's distances; with lights that may move, those of outlines. Fails on options out of range and
    // on the criterion of another tree. Cost: some cuts, a microsecond a node each.
    static Result<LevelChain> create(const vdtree::VertexTree& tree, const vdtree::DistanceCriterion& criterion,
                                     const LevelChainOptions& options = {});

    // For comparison: levels whose triangles shrink by one factor.
    static Result<LevelChain> by_triangles(const vdtree::VertexTree& tree, const vdtree::DistanceCriterion& criterion,
                                           const LevelChainOptions& options = {});

    int size() const noexcept { return static_cast<int>(levels_.size()); } // 1 or more
    vdtree::Index triangles(int level) const noexcept { return levels_[static_cast<std::size_t>(level)].triangles; }
    // The distance from which nobody sees the level, mesh units; 0 for the full mesh, and for a level that only folds what
    // shows nowhere; infinite if the criterion calls the level visible from everywhere.
    double unseen_from(int level) const noexcept;

    // Computed in each call, in the time of a cut.
    vdtree::Cut cut(int level) const;

private:
    struct Level {
        vdtree::Index triangles = 0;
        double distance = 0; // mesh units; nodes fold that are seen from no farther
    };
    LevelChain(const vdtree::VertexTree& tree, std::vector<float> seen_from);
    static Result<LevelChain> prepare(const vdtree::VertexTree& tree, const vdtree::DistanceCriterion& criterion,
                                      const LevelChainOptions& options);
    double distance_of(vdtree::Index triangles) const; // that leaves at most so many
    void add(double distance);
    vdtree::Cut cut_at(double distance) const;

    std::shared_ptr<const vdtree::VertexTree> tree_;
    std::shared_ptr<const std::vector<float>> seen_from_; // by interior node, mesh units: no fold of it is seen beyond
    std::vector<Level> levels_;
};

// The levels of an object of the session, by the fold test that the session chooses for the request. The goal is
// ignored. Measures folds as Session::prepare() does; call that for all objects before anything else.
Result<LevelChain> level_chain(Session& session, const vdtree::View& view, Request request, std::size_t object = 0,
                               const LevelChainOptions& options = {});

} // namespace unseen::session
