// Levels of detail for engines that show few meshes an object: which, and from how far on nobody sees the difference.
//
//     auto lod = session::make_levels(*session, *context);
//     for (const session::LodLevel& level : lod->objects[0].levels) use(level.distance, level.coverage);
//     session::write_levels("out.glb", session->scene(), *lod);
#pragma once

#include <unseen/session_gpu/picture_judge.h>

namespace unseen::session {

inline constexpr int usual_lod_directions = 12;

// Error messages call these fields lod.levels and so on.
struct LodOptions {
    LevelChainOptions chain = {.levels = 5}; // with the full mesh
    int directions = usual_lod_directions;   // that each level is looked at from, 1 to 1000
    // Levels begin where they are seen at up to this many thresholds, see Goal::cost; above 0. 1: not at all.
    double cost = 1;
    // Samples a pixel of the judged pictures, 1 to 256. What shows with fewer is judged again with all of them.
    int samples = 64;
    std::uint64_t seed = 1; // of the directions
    // The vertical field of the target camera over the whole display, in (0, 180). Not set: the field that the display
    // fills for the observer.
    std::optional<double> fov_y_degrees = {};
    Progress progress = {}; // returning false stops, with the error `cancelled`
};

// The verdicts of both judges on a level from one direction, at its distance.
struct LodCheck : PictureVerdict {
    glm::dvec3 direction = glm::dvec3(0, 0, 1); // unit, from the object towards the eye, in the world
};

struct LodLevel {
    int chain_level = 0; // of LodObject::chain
    vdtree::Index triangles = 0;
    // From here on the level is shown: from the eye to the middle of the object's bounding sphere, world units. 0 for
    // the full mesh.
    double distance = 0;
    double promised_distance = 0; // by the fold test, before the judges looked
    // The share of the display's area that the bounding sphere takes there, in a view of its middle; 1 at most.
    double coverage = 1;
    double shift = 0;       // the largest distance between a vertex of the full model and its replacement, world units
    double pixel_error = 0; // the same in pixels, where it is nearest to the eye
    std::vector<LodCheck> checks = {}; // at `distance`, from directions that no earlier decision used
};

struct LodObject {
    std::string name;
    std::size_t object = 0;  // of the scene
    std::size_t same_as = 0; // the first object of Lod::objects with these levels; itself: none before
    WorldSphere sphere;
    LevelChain chain;
    std::vector<LodLevel> levels;    // the full mesh first, at ascending distances
    std::vector<Message> notes = {}; // levels that were left out and why, one sentence each

    vdtree::Cut cut(std::size_t level) const { return chain.cut(levels[level].chain_level); }
};

struct Lod {
    std::vector<LodObject> objects; // of the scene
    double fov_y_degrees = 0;       // that coverages and distances are for, with the display's pixels
    int width_px = 0, height_px = 0;
    int directions = 0, samples = 0;
    double cost = 1;         // LodOptions::cost
    std::uint64_t looks = 0; // pairs of pictures that were judged
};

// Of the bounding sphere's outline where the level begins, pixels.
double height_px(const Lod& lod, const LodLevel& level);

// The levels of each object, alone before the scene's background and under its lights. LevelChain proposes them: evenly
// spaced in visibility, the same from all sides. Both judges then compare each level with the full mesh at its
// distance, from random directions off the axes: first nearer and nearer from a few, as long as neither finds more than
// lod_most times the cost, then from all. If either does there, the distance grows by a fifth and the level is judged from
// new directions; so the reported checks never influenced the distance.
// At every distance the whole object fits on the display.
//
// A level is left out if one with fewer triangles begins at the same distance, up to lod_step, or if it is visible from
// everywhere; notes say so. Objects of the same tree and size share their checks if the scene has no lights.
//
// Fails on options out of range, and where Session::prepare() and drawing do. Cost: two drawings and judgements for
// each direction.
Result<Lod> make_levels(Session& session, const render::Context& context, const LodOptions& options = {});

// The factor by which a distance grows if the level is seen, and the least factor between the distances of levels.
inline constexpr double lod_growth = 1.2, lod_step = 1.05;
// The largest difference that the judges may find, in thresholds. It is below 1, where a level is seen, because
// directions that were not checked may be somewhat worse.
inline constexpr double lod_most = 0.75;

// The view in which level and full mesh are compared: the display's pixels, cropped to the sphere and a margin.
vdtree::View lod_view(const Lod& lod, const WorldSphere& sphere, glm::dvec3 direction, double distance);
// Random directions all over the sphere, none within 5 degrees of an axis. The same on all machines.
std::vector<glm::dvec3> lod_directions(int count, std::uint64_t seed);

// Writes all levels as one glTF file with the extension MSFT_lod. Viewers without it show the full meshes. Each
// coverage says where a level ends; the last one ends at 0. The backdrop is written whole. `only`: this level of all
// objects; those with fewer levels have their last one. Notes and errors are those of meshio::write_scene().
Result<meshio::LevelsWritten> write_levels(const std::filesystem::path& file, const Scene& scene, const Lod& lod,
                                           const meshio::GltfOptions& options = {},
                                           std::optional<std::size_t> only = {});

} // namespace unseen::session
