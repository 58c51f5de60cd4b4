// Scenes to try things out with: the kinds that Drettakis and others (2007) test on, made of a scanned mesh where one
// is at hand and of meshes made by code. Each has a camera, lights and a background.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include <unseen/vdtree/function_ref.h>
#include <unseen/vdtree/result.h>

namespace unseen::app {

enum class SceneKind {
    museum,   // a statue behind a gate of bars, with the sun on it through a window with bars
    treasure, // a chamber with many statues, urns and rings
    house,    // a front with columns, statues and balcony bars, trees before it
    forest,   // statues among trees of thousands of leaves
    building, // fifty furnished rooms with doors between them
    // After those of Arlebrink and Linde (2018), forty objects each:
    spheres, // spheres alone, close to each other
    bunnies, // two of the statues, far from each other: bunnies and dragons where these are given
    models,  // spheres and all statues, some in a crowd, some apart
};

// Which bars a museum has.
enum class MuseumBars { both, gate, window, none };

struct MakeSceneOptions {
    SceneKind kind = SceneKind::museum;
    std::uint64_t triangles = 0; // of all objects, about; 0: as the kind has them, 0.3 to 2.8 million
    std::uint64_t seed = 1;      // of what is strewn about
    double bars_per_metre = 8;   // of museums, 1 to 100
    MuseumBars bars = MuseumBars::both;
    // Statues: meshes to take instead of the bunny of Debian's package glmark2-data, which is taken where it is
    // installed, and left out where not. Of the last three kinds: those with more triangles than an object may have are
    // simplified; the other kinds leave them out.
    std::vector<std::filesystem::path> statues = {};
    Progress progress = {};

    static constexpr std::uint64_t least_triangles = 10'000, most_triangles = 100'000'000;
};

struct MadeScene {
    std::uint64_t objects = 0, triangles = 0; // of nodes that are no background
    std::uint64_t meshes = 0, mesh_triangles = 0, background_triangles = 0;
    std::vector<std::string> left_out; // a sentence for each statue that has more triangles than fit
};

// Writes a scene as .glb. The same file for the same options, whatever the machine's cores. Fails on options out of
// range, statues that cannot be read, and where the file cannot be written.
Result<MadeScene> make_scene(const std::filesystem::path& file, const MakeSceneOptions& options);

} // namespace unseen::app
