// unseen render: a picture of a cut, for people or for judging.
#include <iterator>
#include <memory>

#include <unseen/perception/image.h>
#include <unseen/render/internal/layers.h>
#include <unseen/render/renderer.h>
#include <unseen/session_gpu/scene_renderer.h>

#include "cut_report.h"
#include "fold_map.h"
#include "on_gpu.h"
#include "output_files.h"
#include "report.h"
#include "session_options.h"
#include "terminal.h"
#include "verbs.h"

namespace unseen::app {
namespace {

struct RenderArguments {
    ViewOptions& view;
    DisplayOptions& display;
    std::string model = {}, out = {}, json = {};
    WhatOptions what = {};
    GazeOptions gaze = {};
    bool is_verbose = false;
    render::DrawOptions draw = {};
    std::optional<FoldMap> map = {}; // in place of the picture
};

bool is_for_people(const std::string& file) { return has_ending(file, ".png"); }

Json shadows_json(const render::ShadowFacts& shadows, const session::Session& session) {
    const auto& lights = *session.scene().lights;
    return {{"casting_lights", lights.casting()},
            {"of_lights", lights.light_count()},
            {"maps", shadows.maps},
            {"map_size", shadows.size},
            {"bytes", shadows.bytes},
            {"draw_ms", shadows.draw_ms}};
}

Result<perception::Image> image_of(const RenderArguments& a, session::Session& session, const vdtree::View& view,
                                   const session::Request& request, const session::Simplification& result,
                                   const render::Frame& frame) {
    if (a.map) return draw_fold_map(result.cuts.front(), session, view, request, *a.map, view);
    const perception::Display& display = session.observer().display;
    return is_for_people(a.out) ? session::code_image(frame, display) : session::light_image(frame, display);
}

void print(const RenderArguments& a, const session::Session& session, const session::Simplification& result,
           double draw_ms, const std::string& renderer) {
    print_scene(session);
    print_line(kept_text(result.stats.triangles, result.source_triangles));
    print_line(visibility_text(result, session.observer(), a.display, "in this view"));
    print_written({a.out, a.json});
    if (!a.is_verbose) return;
    print_details(result, draw_ms);
    print_line("drawn by " + renderer);
}

Result<int> run(RenderArguments& a) {
    auto report = open_report(inputs_of(a.model, a.view, a.display), {a.out}, a.json);
    if (!report) return report.error();
    const auto gaze = session::GazePlayer::create(a.gaze);
    if (!gaze) return gaze.error();
    auto context = render::Context::headless();
    if (!context) return context.error();
    a.view.measures = a.what.needs_measurement();
    auto session = open_session(a.model, a.view, a.display);
    if (!session) return session.error();
    const vdtree::View view = make_view(*session, a.view);
    session->set_gaze(gaze->at(0, view, a.what.gaze_px));
    session->set_velocity(a.what.velocity());
    session::Request request = a.what.request_for(session->triangle_count());
    request.purpose = session::Purpose::picture;
    if (a.map && session->scene().objects.size() != 1)
        return Error{ErrorCode::invalid_argument, "--show draws one object, and the scene has " +
                                                      grouped(session->scene().objects.size()) +
                                                      ": leave it out, or give --as model."};
    const auto result = simplify_by(a.what, *session, view, request, &*context);
    if (!result) return result.error();

    auto renderer = session::SceneRenderer::create(*context, *session);
    if (!renderer) return renderer.error();
    render::DrawOptions options = a.draw;
    options.background = session->background();
    const auto frame = renderer->draw(session::drawn_cuts(result->cuts), view, options);
    if (!frame) return frame.error();
    const auto image = image_of(a, *session, view, request, *result, *frame);
    if (!image) return image.error();
    Json json = to_json(*result, frame->draw_ms);
    add_scene(json, *session, result->cuts);
    if (const auto shadows = renderer->shadows()) json["shadows"] = shadows_json(*shadows, *session);
    if (auto ok = report->prepare(json); !ok) return ok.error();
    if (auto ok = perception::write_image(a.out, *image); !ok) return ok.error();
    if (auto ok = report->publish(); !ok) return ok.error();
    if (!report->is_on_stdout()) print(a, *session, *result, frame->draw_ms, context->renderer_name());
    return exit_done;
}

std::vector<Rule> render_rules() {
    return {
        {"--show cost", Rule::excludes, {"--full"}, "nothing is folded"},
        {"--show contrast", Rule::excludes, {"--lights"}, "the map is of the mesh's own light"},
        {"--show eccentricity", Rule::needs_one_of, {"--gaze", "--gaze-mode"}, "without a gaze all of it is foveal"},
        {"--show", Rule::excludes, {"--wireframe", "--samples"}, "a map of folds has neither edges nor samples"},
        {"--show", Rule::excludes, {"--eyes"}, "a map is of one view"},
        {"--gaze", Rule::excludes, {"--gaze-mode"}},
        {"--tracker", Rule::needs_one_of, {"--gaze", "--gaze-mode"}}};
}

} // namespace

Command render_command(CLI::App& app, Setup& setup) {
    auto a = std::make_shared<RenderArguments>(RenderArguments{setup.view_options(), setup.display_options()});
    CLI::App* verb = app.add_subcommand("render", "Draw a simplification of a model or a scene for a view");
    add_model_option(*verb, a->model);
    add_value(*verb, "-o,--output", a->out, ending_in({".png", ".pfm", ".exr"}), "OUT.png|.pfm|.exr",
              "PNG for people; PFM or EXR for judging: cd/m2, as RGB where anything has a colour")
        ->required();
    add_samples_option(*verb, a->draw.samples, "16; PFM and EXR, which are judged: 64");
    verb->add_flag("--wireframe", a->draw.wireframe, "Draw the triangles' edges, too");
    std::vector<std::pair<std::string, FoldMap>> maps;
    for (std::size_t i = 0; i < std::size(fold_map_names); ++i)
        maps.emplace_back(fold_map_names[i], static_cast<FoldMap>(i));
    add_choice(*verb, "--show", a->map, std::move(maps),
               "In place of the model, why it folds: cost, frequency or contrast (of the worst gratings), or "
               "eccentricity");
    add_json_option(*verb, a->json);
    add_verbose_option(*verb, a->is_verbose);
    std::vector<Rule> rules = render_rules();
    add_what_options(*verb, a->what, rules);
    add_hiding_option(*verb, a->what, rules);
    CLI::Option* visibility = verb->get_option("--visibility");
    visibility->description(visibility->get_description() +
                            "; default: picture; spheres in orthographic views and for two eyes");
    add_check_options(*verb, a->what, rules);
    add_choice<GazeSource, GazeSource>(*verb, "--gaze-mode", a->gaze.source, {{"head", GazeSource::head}},
                                       "head: no tracker; the viewer looks within 15 degrees of the middle");
    add_tracker_option(*verb, a->gaze, false);
    setup.act_in(*verb, Setup::view | Setup::parallel | Setup::two_eyes | Setup::model | Setup::scenes);
    verb->callback([a, visibility, samples = verb->get_option("--samples")] {
        const bool is_of_one_picture = !a->view.is_orthographic && a->view.eye_distance == 0;
        if (visibility->empty() && is_of_one_picture) a->what.hiding = Hiding::picture;
        if (a->map && !is_for_people(a->out)) refuse("--show draws pictures for people: -o must end in .png.");
        // With fewer, an outline that moves by a fiftieth of a pixel changes a whole sample of some pixel: by more than
        // can be seen.
        if (samples->empty() && !is_for_people(a->out)) a->draw.samples = samples_to_judge;
    });
    verb->footer("Examples:\n  unseen render bunny.vdt -o bunny.png --wireframe\n"
                 "  unseen render bunny.vdt -o full.pfm --full --size 1024\n"
                 "  unseen render bunny.vdt -o aside.pfm --gaze 1603 512 --json -\n"
                 "  unseen render bunny.vdt -o cost.png --gaze 1603 512 --show cost\n"
                 "  unseen render bunny.vdt -o pair.png --eyes 0.063 --triangles 20k\n"
                 "  unseen render part.stl -o front.png --orthographic fit --direction 0 -1 0 --up 0 0 1\n"
                 "  unseen render museum.glb -o museum.png --json -\n"
                 "  unseen render dragon.vdt -o lit.png --lights lights.json --setup lab.json");
    return {verb, [a] { return run(*a); }, std::move(rules)};
}

} // namespace unseen::app
