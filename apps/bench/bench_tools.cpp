#include "bench_tools.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>

#include <sample_mesh.h>
#include <unseen/vdtree/builder.h>

#include "child_process.h"
#include "terminal.h"

namespace unseen::app {
namespace {

namespace fs = std::filesystem;
constexpr double idle_load = 0.5; // of a machine that does nothing else, with what has just been built or copied
constexpr double active_tolerance = 0.002; // how near a threshold must come to the triangles asked for

} // namespace

double median(std::vector<double> values) {
    if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

Pinned::Pinned() {
    CPU_ZERO(&before_);
    if (sched_getaffinity(0, sizeof before_, &before_) != 0) return;
    int last = -1;
    for (int core = 0; core < CPU_SETSIZE; ++core)
        if (CPU_ISSET(core, &before_)) last = core;
    if (last < 0) return;
    cpu_set_t one;
    CPU_ZERO(&one);
    CPU_SET(last, &one);
    is_pinned_ = sched_setaffinity(0, sizeof one, &one) == 0;
}

Pinned::~Pinned() {
    if (is_pinned_) sched_setaffinity(0, sizeof before_, &before_);
}

fs::path find_in_checkout(const fs::path& relative) {
    for (const fs::path& start : {fs::current_path(), fs::path(own_executable()).parent_path()}) {
        for (fs::path folder = start; !folder.empty(); folder = folder.parent_path()) {
            std::error_code unknown;
            if (fs::exists(folder / relative, unknown)) return folder / relative;
            if (folder == folder.parent_path()) break;
        }
    }
    return {};
}

std::string command_beside(const std::string& name) {
    const fs::path file = fs::path(own_executable()).parent_path() / name;
    std::error_code unknown;
    return fs::exists(file, unknown) ? file.string() : name;
}

bool MachineLoad::is_high() const { return average > idle_load; }

std::string MachineLoad::advice() const {
    if (!is_high()) return {};
    return "the machine was busy when this began (load average " + rounded(average, 3) +
           "): times and rates come out worse than they are. End other programs, wait a minute and measure again; "
           "counts, memory and pixels "
           "are as on an idle machine.";
}

MachineLoad machine_load() {
    double average = 0;
    return {getloadavg(&average, 1) == 1 ? average : std::numeric_limits<double>::quiet_NaN()};
}

std::vector<std::string> installed_meshes() {
    constexpr const char* bunny =
        "/usr/share/glmark2/models/bunny.obj"; // of Debian's glmark2-data, which quickstart installs
    std::vector<std::string> files;
    std::error_code unknown;
    if (fs::exists(bunny, unknown)) files.push_back(bunny);
    if (const fs::path dragon = find_in_checkout(dragon_file); !dragon.empty()) files.push_back(dragon.string());
    return files;
}

Result<vdtree::VertexTree> sample_tree() {
    print_note("neither the bunny nor the dragon is there ('./quickstart --dragon' fetches them): a sphere with bumps "
               "stands in.");
    constexpr int rows = 130; // 67,600 triangles
    const vdtree::Mesh mesh = bumpy_sphere(rows);
    return vdtree::build_tree(mesh.view());
}

double full_tests_per_second(const vdtree::VertexTree& tree, const vdtree::DistanceCriterion& criterion,
                             const vdtree::Viewpoint& viewpoint, const vdtree::FollowOptions& options, int repeats) {
    std::vector<double> rates;
    for (int i = 0; i < repeats; ++i) {
        const auto start = BenchClock::now();
        if (!vdtree::test_every_node(tree, criterion, viewpoint, options))
            return std::numeric_limits<double>::quiet_NaN();
        rates.push_back(static_cast<double>(tree.interior_count()) / seconds_since(start));
    }
    return median(rates);
}

AimedThreshold aim_for(vdtree::Index triangles, const FunctionRef<vdtree::Index(float)>& follow) {
    double low = -20, high = 20; // log2
    AimedThreshold aimed;
    constexpr int steps = 24;
    for (int step = 0; step < steps; ++step) {
        const double middle = (low + high) / 2;
        aimed.threshold = static_cast<float>(std::exp2(middle));
        aimed.triangles = follow(aimed.threshold);
        if (std::abs(static_cast<double>(aimed.triangles) - triangles) <= active_tolerance * triangles) break;
        (aimed.triangles > triangles ? low : high) = middle;
    }
    return aimed;
}

} // namespace unseen::app
