#include "bench_tools.h"

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <numbers>

#include <scene_parts.h>
#include <seamed_mesh.h>
#include <unseen/vdtree/tree_io.h>

#include "make_scene.h"
#include "terminal.h"

namespace unseen::app {
namespace {

namespace fs = std::filesystem;

// Beside the programs that were built, of the npm package @webxr-input-profiles/assets.
constexpr const char* controller_profiles = "npm/node_modules/@webxr-input-profiles/assets/dist/profiles";

// The file of this program.
fs::path own_executable() {
    std::error_code unknown;
    return fs::read_symlink("/proc/self/exe", unknown);
}

std::vector<std::string> make_each(const BenchFolder& folder, std::uint64_t triangles,
                                   const std::vector<std::string>& statues,
                                   std::initializer_list<std::pair<SceneKind, const char*>> kinds) {
    std::vector<std::string> files;
    for (const auto& [kind, name] : kinds) {
        files.push_back((folder / (name + std::string(".glb"))).string());
        require(make_scene(files.back(),
                           {.kind = kind, .triangles = triangles, .statues = {statues.begin(), statues.end()}}));
    }
    return files;
}

} // namespace

double median(std::vector<double> values) {
    if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::ranges::nth_element(values, middle);
    return *middle;
}

double quantile(std::vector<double> values, double share) {
    if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
    const auto at = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
    std::ranges::nth_element(values, at);
    return *at;
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

MachineLoad MachineLoad::now() {
    double average = 0;
    return {getloadavg(&average, 1) == 1 ? average : std::numeric_limits<double>::quiet_NaN()};
}

std::string MachineLoad::advice() const {
    constexpr double idle = 0.5; // of a machine that does nothing else, with what has just been built or copied
    if (!(average > idle)) return {};
    return "the machine was busy when this began (load average " + rounded(average, 3) +
           "): times and rates come out worse than they are. End other programs, wait a minute and measure again; "
           "counts, memory and pixels are as on an idle machine.";
}

glm::dvec3 Random::direction() {
    const double z = between(-1, 1), turn = between(0, 2 * std::numbers::pi), across = std::sqrt(1 - z * z);
    return {across * std::cos(turn), across * std::sin(turn), z};
}

std::vector<std::string> installed_meshes() {
    constexpr const char* bunny = "/usr/share/glmark2/models/bunny.obj"; // of Debian's glmark2-data
    std::vector<std::string> files;
    std::error_code unknown;
    if (fs::exists(bunny, unknown)) files.push_back(bunny);
    if (const fs::path dragon = find_in_checkout(dragon_file); !dragon.empty()) files.push_back(dragon.string());
    return files;
}

vdtree::VertexTree sample_tree() {
    print_note("neither the bunny nor the dragon is there ('./quickstart --dragon' fetches them): a sphere with bumps "
               "stands in.");
    constexpr int rows = 130; // 67,600 triangles
    return require(vdtree::build_tree(bumpy_sphere(rows).view()));
}

vdtree::Mesh whole_mesh(const vdtree::VertexTree& tree) {
    vdtree::Cut whole(tree);
    whole.unfold_all();
    vdtree::Mesh mesh = vdtree::extract_mesh(whole);
    const vdtree::TextureView texture = tree.texture();
    const auto copy = [](std::span<const vdtree::Texel> texels) { return std::vector(texels.begin(), texels.end()); };
    mesh.texture = {texture.width,        texture.height, texture.wrap_u,         texture.wrap_v,
                    copy(texture.texels), texture.blends, copy(texture.emission), copy(texture.relief)};
    return mesh;
}

vdtree::VertexTree tree_like(const vdtree::VertexTree& own, const vdtree::Mesh& mesh, vdtree::BuildOptions how) {
    how.light = own.light();
    how.prelit = own.is_prelit();
    return require(vdtree::build_tree(mesh.view(), how));
}

fs::path find_in_checkout(const fs::path& relative) {
    for (const fs::path& start : {fs::current_path(), own_executable().parent_path()}) {
        for (fs::path folder = start; !folder.empty(); folder = folder.parent_path()) {
            std::error_code unknown;
            if (fs::exists(folder / relative, unknown)) return folder / relative;
            if (folder == folder.parent_path()) break;
        }
    }
    return {};
}

BenchFolder::BenchFolder(const std::string& kept) : folder_(kept), is_kept_(!kept.empty()) {
    std::error_code failed;
    if (is_kept_) {
        fs::create_directories(kept, failed);
    } else {
        std::string name = (fs::temp_directory_path() / "unseen-bench-XXXXXX").string();
        if (!mkdtemp(name.data())) failed = std::error_code(errno, std::generic_category());
        folder_ = name;
    }
    if (failed)
        throw BenchFailure{
            {ErrorCode::io_failure, "Cannot make the folder '" + folder_.string() + "': " + failed.message() + "."}};
}

BenchFolder::~BenchFolder() {
    std::error_code ignored;
    if (!is_kept_) fs::remove_all(folder_, ignored);
}

std::vector<std::string> make_scenes(const BenchFolder& folder, std::uint64_t triangles) {
    return make_each(folder, triangles, {},
                     {{SceneKind::museum, "museum"},
                      {SceneKind::treasure, "treasure"},
                      {SceneKind::house, "house"},
                      {SceneKind::forest, "forest"}});
}

std::vector<std::string> make_corner_models(const BenchFolder& folder) {
    std::vector<std::string> files;
    for (const auto& [name, make] : {std::pair{corner_models[0], &helmet},
                                     {corner_models[1], &charted_ball},
                                     {corner_models[2], &gear},
                                     {corner_models[3], &hard_boxes}}) {
        files.push_back((folder / (name + std::string(".vdt"))).string());
        require(vdtree::write_tree(files.back(), require(vdtree::build_tree(make().view()))));
    }
    for (const auto& [name, profile] :
         {std::pair{corner_models[4], "htc-vive/none.glb"}, {corner_models[5], "oculus-touch/left.glb"}}) {
        const fs::path file = find_in_checkout(fs::path(controller_profiles) / profile);
        if (file.empty()) {
            print_note("'" + std::string(name) + "' is not there: the test viewers_lod fetches it.");
            continue;
        }
        files.push_back((folder / (name + std::string(".glb"))).string());
        std::error_code failed;
        fs::copy_file(file, files.back(), fs::copy_options::overwrite_existing, failed);
        if (failed)
            throw BenchFailure{
                {ErrorCode::io_failure, "Cannot copy '" + file.string() + "': " + failed.message() + "."}};
    }
    return files;
}

std::vector<std::string> make_scenes_to_select_in(const BenchFolder& folder, const std::vector<std::string>& statues) {
    return make_each(folder, 0, statues,
                     {{SceneKind::spheres, "spheres"}, {SceneKind::bunnies, "bunnies"}, {SceneKind::models, "models"}});
}

Result<ChildOutcome> run_unseen(const std::vector<std::string>& words, std::vector<std::string> launcher) {
    const fs::path beside = own_executable().parent_path() / "unseen";
    std::error_code unknown;
    launcher.push_back(fs::exists(beside, unknown) ? beside.string() : "unseen"); // else found by PATH
    launcher.insert(launcher.end(), words.begin(), words.end());
    return run_child(std::move(launcher));
}

} // namespace unseen::app
