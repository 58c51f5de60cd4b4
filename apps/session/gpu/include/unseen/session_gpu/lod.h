// Levels of detail for engines that show few meshes an object: which, and from how far on nobody sees the difference.
//
//     auto lod = session::make_levels(*session, *context);
//     for (const session::LodLevel& level : lod->objects[0].levels) use(level.distance, level.coverage);
//     session::write_levels("out.glb", session->scene(), *lod);
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <unseen/meshio/level_file.h>
#include <unseen/render/context.h>
#include <unseen/session/level_chain.h>
#include <unseen/session/session.h>

namespace unseen::session {

inline constexpr int usual_lod_directions = 12;

// Error messages call these fields lod.levels and so on.
struct LodOptions {
    LevelChainOptions chain = {.levels = 5}; // with the full mesh
    int directions = usual_lod_directions;   // that each level is looked at from, 1 to 1000
    // Of the pictures that are judged, a pixel, 1 to 256. What shows with fewer is looked at again with all of these.
    int samples = 64;
    std::uint64_t seed = 1; // of the directions
    // The vertical field of the camera that the levels are for, over the whole display; in (0, 180). None: as the display
    // fills the observer's sight.
    std::optional<double> fov_y_degrees = {};
    // Hears what share is done. False: it stops, with the error `cancelled`.
    std::function<bool(double)> progress = {};
};

// What both judges saw of a level from one side, at its distance.
struct LodCheck {
    glm::dvec3 direction = glm::dvec3(0, 0, 1); // unit, from the object towards the eye, in the world
    std::uint64_t visible_pixels = 0, second_visible_pixels = 0;
    double v = 0, second_v = 0; // the largest difference, in thresholds
};

struct LodLevel {
    int chain_level = 0; // of LodObject::chain
    vdtree::Index triangles = 0;
    // From the eye to the middle of the object's bounding sphere, world units: from here on the level is shown. 0 of the
    // full mesh.
    double distance = 0;
    double promised_distance = 0; // what the fold test says, before anybody looked
    // Which share of the display's area the bounding sphere takes there, of a view that looks at its middle; 1 at most.
    double coverage = 1;
    double shift = 0;       // world units: how far a vertex of the full model is from what stands for it, at most
    double pixel_error = 0; // the same in pixels, where it is nearest to the eye
    std::vector<LodCheck> checks = {}; // at `distance`, from sides that no earlier decision had to do with
};

struct LodObject {
    std::string name;
    std::size_t object = 0;  // of the scene
    std::size_t same_as = 0; // the first object of Lod::objects with these levels; itself: none before
    WorldSphere sphere;
    LevelChain chain;
    std::vector<LodLevel> levels;    // the full mesh first, at ascending distances
    std::vector<Message> notes = {}; // levels that are none, and why; one sentence each

    vdtree::Cut cut(std::size_t level) const { return chain.cut(levels[level].chain_level); }
};

struct Lod {
    std::vector<LodObject> objects; // of the scene
    double fov_y_degrees = 0;       // that coverages and distances are for, with the display's pixels
    int width_px = 0, height_px = 0;
    int directions = 0, samples = 0;
    std::uint64_t looks = 0; // pairs of pictures that were judged
};

// Levels of each object of the session's scene, alone before its background, under the scene's lights. LevelChain chooses
// them: evenly spaced in visibility, the same from all sides. Each is then looked at from its distance, full mesh beside
// level, from sides that are spread at random and off the axes, by both judges. Where either finds more than lod_most,
// the distance grows by a fifth, and the level is looked at from other sides; so what is reported was never chosen by. No
// distance is so near that the object does not fit on the display.
//
// Levels that another one with fewer triangles replaces from the same distance on, up to lod_step, are left out, and so
// are those that are seen from everywhere; notes say so. Objects that share a tree, and are as large, share the looks
// where the scene has no lights.
//
// Fails on options out of range, and as Session::prepare() and drawing do. Cost: two drawings and judgements a direction.
Result<Lod> make_levels(Session& session, const render::Context& context, const LodOptions& options = {});

// By how much a distance grows where the level shows, and by how much those of levels differ at least.
inline constexpr double lod_growth = 1.2, lod_step = 1.05;
// In thresholds: what a level may come to where it is looked at. From 1 on it is seen; sides that nobody looked from may
// come to somewhat more than those that somebody did.
inline constexpr double lod_most = 0.75;

// The view that level and full mesh are compared in: the display's pixels, cut to what the sphere takes and a margin.
vdtree::View lod_view(const Lod& lod, const WorldSphere& sphere, glm::dvec3 direction, double distance);
// So many, spread at random over the sphere, none within 5 degrees of an axis. The same on all machines.
std::vector<glm::dvec3> lod_directions(int count, std::uint64_t seed);

// Writes all levels as one glTF file, by the extension MSFT_lod: viewers without it show the full meshes. Each coverage
// says where a level ends, and the last ends at 0. Backgrounds go whole. Notes and errors as of meshio::write_scene().
Result<meshio::LevelsWritten> write_levels(const std::filesystem::path& file, const Scene& scene, const Lod& lod,
                                           const meshio::GltfOptions& options = {});
// One of them alone, of all objects; objects that have fewer levels with their last.
Result<meshio::LevelsWritten> write_level(const std::filesystem::path& file, const Scene& scene, const Lod& lod,
                                          std::size_t level, const meshio::GltfOptions& options = {});

} // namespace unseen::session
