// unseen lod: levels of detail with the distances from which nobody sees them, for engines.
#include <algorithm>
#include <filesystem>
#include <memory>

#include <unseen/session_gpu/lod.h>

#include "cut_report.h"
#include "level_sheet.h"
#include "output_files.h"
#include "progress_bar.h"
#include "report.h"
#include "session_options.h"
#include "terminal.h"
#include "verbs.h"

namespace unseen::app {
namespace {

struct LodArguments {
    ViewOptions& view;
    DisplayOptions& display;
    std::string model = {}, out = {}, json = {}, csv = {}, sheet = {};
    bool is_separate = false;
    session::Goal quality = {}; // what --quality says
    session::LodOptions options = {};
    meshio::GltfOptions gltf = {};
};

// "out.glb", 2: "out_lod2.glb".
std::string level_file(const std::string& file, int level) {
    const std::filesystem::path path(file);
    return (path.parent_path() / (path.stem().string() + "_lod" + std::to_string(level) + path.extension().string()))
        .string();
}

struct Worst {
    std::uint64_t visible = 0, second_visible = 0;
    double v = 0, second_v = 0;
};

Worst worst_of(const session::LodLevel& level) {
    Worst worst;
    for (const session::LodCheck& check : level.checks) {
        worst.visible = std::max(worst.visible, check.visible_pixels);
        worst.second_visible = std::max(worst.second_visible, check.second_visible_pixels);
        worst.v = std::max(worst.v, check.v), worst.second_v = std::max(worst.second_v, check.second_v);
    }
    return worst;
}

Json level_json(const session::Lod& lod, const session::LodLevel& level) {
    Json checks = Json::array();
    for (const session::LodCheck& check : level.checks)
        checks.push_back({{"direction", {check.direction.x, check.direction.y, check.direction.z}},
                          {"visible_pixels", check.visible_pixels},
                          {"second_visible_pixels", check.second_visible_pixels},
                          {"v", number_or_null(check.v)},
                          {"second_v", number_or_null(check.second_v)}});
    return {{"triangles", level.triangles},
            {"distance_m", level.distance},
            {"promised_distance_m", level.promised_distance},
            {"coverage", level.coverage},
            {"height_px", session::height_px(lod, level)},
            {"error_m", level.shift},
            {"pixel_error", level.pixel_error},
            {"checks", std::move(checks)}};
}

// A line for each level of each object.
std::string to_csv(const session::Lod& lod) {
    std::string text = "object,level,triangles,distance_m,coverage,error_m,pixel_error,directions,visible_pixels,v,"
                       "second_visible_pixels,second_v\n";
    for (const session::LodObject& object : lod.objects)
        for (std::size_t i = 0; i < object.levels.size(); ++i) {
            const session::LodLevel& level = object.levels[i];
            const Worst worst = worst_of(level);
            text += csv_line({object.name, i, level.triangles, level.distance, level.coverage, level.shift,
                              level.pixel_error, level.checks.size(), worst.visible, worst.v, worst.second_visible,
                              worst.second_v});
        }
    return text;
}

void print(const session::Lod& lod, const meshio::LevelsWritten& written) {
    const bool is_one = lod.objects.size() == 1;
    constexpr std::size_t most_printed = 20; // objects: more are in the JSON
    std::vector<std::vector<std::string>> rows = {
        {"", "level", "triangles", "of all", "from, m", "height, px", "error, px", "largest V", "second judge"}};
    for (std::size_t k = 0; k < std::min(lod.objects.size(), most_printed); ++k) {
        const session::LodObject& object = lod.objects[k];
        for (std::size_t i = 0; i < object.levels.size(); ++i) {
            const session::LodLevel& level = object.levels[i];
            const Worst worst = worst_of(level);
            const double share = 100.0 * level.triangles / std::max<vdtree::Index>(object.levels[0].triangles, 1);
            rows.push_back({i == 0 && !is_one ? object.name : "", std::to_string(i), grouped(level.triangles),
                            rounded(share, 3) + "%", i == 0 ? "-" : rounded(level.distance, 4),
                            i == 0 ? "-" : rounded(session::height_px(lod, level), 3),
                            i == 0 ? "-" : rounded(level.pixel_error, 2), i == 0 ? "-" : rounded(worst.v, 2),
                            i == 0 ? "-" : rounded(worst.second_v, 2)});
        }
    }
    print_table(rows);
    if (lod.objects.size() > most_printed)
        print_line("... and " + std::to_string(lod.objects.size() - most_printed) + " more objects: see --json.");
    print_line("from: the eye's distance to the middle of the object, and the height of its bounding "
               "sphere there, for a vertical field of " +
               rounded(lod.fov_y_degrees, 3) + " degrees over " + std::to_string(lod.width_px) + "x" +
               std::to_string(lod.height_px) + " pixels. V: the largest difference from " +
               std::to_string(lod.directions) + " sides at that distance, in thresholds; from 1 on it is seen" +
               (lod.cost > 1 ? ", which --quality allows." : "."));
    for (const session::LodObject& object : lod.objects)
        if (object.same_as == object.object)
            for (const std::string& note : object.notes) print_note((is_one ? "" : object.name + ": ") + note);
    std::string sizes;
    for (const std::uint64_t bytes : written.bytes) sizes += (sizes.empty() ? "" : ", ") + file_size(bytes);
    if (!sizes.empty()) print_line("geometry by level: " + sizes);
}

Json to_json(const session::Lod& lod, const session::Session& session, const meshio::LevelsWritten& written,
             const std::vector<std::string>& files) {
    Json objects = Json::array();
    for (const session::LodObject& object : lod.objects) {
        Json levels = Json::array();
        for (const session::LodLevel& level : object.levels) levels.push_back(level_json(lod, level));
        const glm::dvec3 c = object.sphere.centre;
        objects.push_back({{"name", object.name},
                           {"centre_m", {c.x, c.y, c.z}},
                           {"radius_m", object.sphere.radius},
                           {"same_as", lod.objects[object.same_as].name},
                           {"levels", std::move(levels)},
                           {"notes", object.notes}});
    }
    Json sizes = Json::array();
    for (const std::string& file : files) {
        std::error_code unknown;
        sizes.push_back({{"file", std::filesystem::path(file).filename().string()},
                         {"bytes", std::filesystem::file_size(file, unknown)}});
    }
    return {{"source_triangles", session.triangle_count()},
            {"display", session.observer().display.name},
            {"observer", session::describe(session.observer())},
            {"width_px", lod.width_px},
            {"height_px", lod.height_px},
            {"fov_y_degrees", lod.fov_y_degrees},
            {"directions", lod.directions},
            {"samples", lod.samples},
            {"cost", lod.cost},
            {"looks", lod.looks},
            {"objects", std::move(objects)},
            {"geometry_bytes", written.bytes},
            {"files", std::move(sizes)}};
}

// One file a level, of those that there are.
Result<std::vector<std::string>> write_separately(const LodArguments& a, const session::Scene& scene,
                                                  const session::Lod& lod, std::vector<std::string> files) {
    std::size_t most = 1;
    for (const session::LodObject& object : lod.objects) most = std::max(most, object.levels.size());
    files.resize(std::min(files.size(), most));
    for (std::size_t i = 0; i < files.size(); ++i)
        if (const auto one = session::write_levels(files[i], scene, lod, a.gltf, i); !one) return one.error();
    return files;
}

Result<session::Lod> make_levels(LodArguments& a, session::Session& session, const render::Context& context) {
    if (session.scene().objects.empty())
        return Error{ErrorCode::invalid_argument, "'" + a.model + "' has no objects: all of it is background."};
    a.options.cost = a.quality.cost;
    ProgressBar bar("judging levels");
    a.options.progress = std::ref(bar);
    return session::make_levels(session, context, a.options);
}

Result<int> run(LodArguments& a) {
    std::vector<std::string> files;
    if (a.is_separate)
        for (int i = 0; i < a.options.chain.levels; ++i) files.push_back(level_file(a.out, i));
    std::vector<std::string> outputs = {a.out, a.sheet};
    outputs.insert(outputs.end(), files.begin(), files.end());
    auto report = open_report(inputs_of(a.model, a.view, a.display), outputs, a.json, a.csv);
    if (!report) return report.error();
    if (a.gltf.meshopt && !meshio::has_meshoptimizer())
        return Error{ErrorCode::unsupported, "--meshopt is not in this build, for it was made without the library "
                                             "meshoptimizer: install libmeshoptimizer-dev and build again."};
    auto context = render::Context::headless();
    if (!context) return context.error();
    auto session = open_session(a.model, a.view, a.display);
    if (!session) return session.error();
    const auto lod = make_levels(a, *session, *context);
    if (!lod) return lod.error();

    const auto written = session::write_levels(a.out, session->scene(), *lod, a.gltf);
    if (!written) return written.error();
    for (const auto& note : written->notes) print_note(a.out + ": " + note);
    const auto separate = write_separately(a, session->scene(), *lod, files);
    if (!separate) return separate.error();
    if (!a.sheet.empty()) {
        const auto sheet =
            draw_level_sheet(*session, *context, *lod, std::filesystem::path(a.model).filename().string());
        if (!sheet) return sheet.error();
        if (auto ok = perception::write_image(a.sheet, *sheet); !ok) return ok.error();
    }
    if (auto ok = report->write(to_json(*lod, *session, *written, *separate), to_csv(*lod)); !ok) return ok.error();
    if (report->is_on_stdout()) return exit_done;
    print_scene(*session);
    print(*lod, *written);
    std::vector<std::string> all = {a.out};
    all.insert(all.end(), separate->begin(), separate->end());
    all.insert(all.end(), {a.csv, a.json, a.sheet});
    print_written(all);
    return exit_done;
}

} // namespace

Command lod_command(CLI::App& app, Setup& setup) {
    auto a = std::make_shared<LodArguments>(LodArguments{setup.view_options(), setup.display_options()});
    CLI::App* verb =
        app.add_subcommand("lod", "Make levels of detail with the distances from which nobody sees them, for engines");
    add_model_option(*verb, a->model);
    add_value(*verb, "-o,--output", a->out, ending_in({".glb", ".gltf"}), "OUT.glb|.gltf",
              "All levels, by the extension MSFT_lod")
        ->required();
    verb->add_flag("--separate", a->is_separate, "Also a file a level: OUT_lod0.glb, ...");
    add_value(*verb, "--levels", a->options.chain.levels, whole(2, session::most_levels), "N",
              "Most levels, the full mesh included (default: 5)");
    verb->add_option_function<double>(
            "--coarsest", [a](double percent) { a->options.chain.least_share = percent / 100; },
            "Triangles of the last level, in percent of the full mesh's (default: 1)")
        ->type_name("PERCENT")
        ->check(within(1e-4, 50));
    add_quality_option(*verb, a->quality);
    add_value(*verb, "--directions", a->options.directions, whole(1, 1000), "N",
              "From how many sides each level is judged (default: 12)");
    add_samples_option(*verb, a->options.samples, "64");
    add_value(*verb, "--seed", a->options.seed, whole(0, 1e9), "N", "For the directions (default: 1)");
    add_value(
        *verb, "--fov", a->options.fov_y_degrees, within(1, 179), "DEGREES",
        "Vertical field of the engine's camera, over the whole display (default: as the display fills the sight)");
    verb->add_flag("--quantize", a->gltf.quantize, "Numbers of 16 bits: KHR_mesh_quantization");
    verb->add_flag("--meshopt", a->gltf.meshopt, "Compressed: EXT_meshopt_compression");
    verb->add_option("--csv", a->csv, "A line for each level")->type_name("FILE.csv");
    add_value(*verb, "--sheet", a->sheet, ending_in({".png"}), "SHEET.png",
              "A picture of the levels: where each begins, and from near by");
    add_json_option(*verb, a->json);
    setup.act_in(*verb, Setup::model | Setup::scenes);
    verb->footer(
        "The levels are evenly spaced in visibility. The fold test says from where nobody sees a level, or with\n"
        "--quality, no more than that many thresholds of it. Two judges look at it from random directions, nearer and\n"
        "nearer, until either sees more; where one does in the last test, the distance grows. A model has one chain "
        "of\n"
        "levels; in a scene each node has its own.\n\n"
        "Examples:\n  unseen lod statue.glb -o statue_lods.glb --separate --csv statue.csv\n"
        "  unseen lod bunny.ply -o bunny.glb --levels 4 --quantize --meshopt\n"
        "  unseen lod bunny.ply -o bunny.glb --quality good\n"
        "  unseen lod museum.glb -o museum_lods.glb --display tv.json --fov 60 --json -");
    return {verb, [a] { return run(*a); }};
}

} // namespace unseen::app
