// unseen render: a picture of a cut, for people or for judging.
#include <filesystem>
#include <map>
#include <memory>

#include <perception/image.h>
#include <render/renderer.h>

#include "command.h"
#include "frame_image.h"
#include "report.h"
#include "simplification.h"
#include "terminal.h"

namespace unseen::app {
namespace {

struct RenderArguments {
    std::string model, out, json;
    ViewOptions view;
    DisplayOptions display;
    WhatOptions what;
    render::DrawOptions draw;
};

bool is_for_people(const std::string& file) {
    const std::string ending = std::filesystem::path(file).extension().string();
    return ending == ".png" || ending == ".PNG";
}

Result<int> run(const RenderArguments& a) {
    std::error_code unknown;
    if (std::filesystem::equivalent(a.model, a.out, unknown))
        return Error{ErrorCode::invalid_argument,
                     "'" + a.out + "' is the model itself: give the picture another name."};
    auto report = JsonReport::open(a.json);
    if (!report) return report.error();
    const auto scene = load_scene(a.model, a.view, a.display);
    if (!scene) return scene.error();
    auto context = render::Context::headless();
    if (!context) return context.error();
    auto renderer = render::Renderer::create(*context, scene->tree);
    if (!renderer) return renderer.error();

    vdtree::Cut cut(scene->tree);
    const Simplification result = simplify(cut, *scene, a.what, Purpose::picture);
    render::DrawOptions options = a.draw;
    options.background = scene->background;
    const auto frame = renderer->draw(cut, scene->view, options, scene->placement);
    if (!frame) return frame.error();

    const perception::Image image =
        is_for_people(a.out) ? code_image(*frame, scene->display) : luminance_image(*frame, scene->display);
    if (auto ok = report->prepare(to_json(result, frame->draw_ms)); !ok) return ok.error();
    if (auto ok = perception::write_image(a.out, image); !ok) return ok.error();
    if (auto ok = report->publish(); !ok) return ok.error();
    if (!report->is_on_stdout()) {
        print(result, frame->draw_ms);
        print_table({{"drawn by", context->renderer_name()}});
    }
    return exit_done;
}

} // namespace

Command render_command(CLI::App& app) {
    auto a = std::make_shared<RenderArguments>();
    CLI::App* verb = app.add_subcommand("render", "Draw a simplification for a view");
    verb->add_option("TREE", a->model, "A tree, or a mesh")->required()->type_name("TREE.vdt|MESH");
    verb->add_option("-o,--output", a->out, "PNG for people; PFM or EXR for judging: luminance in cd/m2")
        ->type_name("OUT.png|.pfm|.exr")
        ->required()
        ->check(ending_in({".png", ".pfm", ".exr"}));
    verb->add_option("--samples", a->draw.samples, "Samples a pixel, 1 to 256 (default: 16)")
        ->type_name("N")
        ->check(within(1, 256));
    verb->add_flag("--wireframe", a->draw.wireframe, "Draw the triangles' edges, too");
    const std::map<std::string, render::Shading> shadings = {{"smooth", render::Shading::smooth},
                                                             {"flat", render::Shading::flat}};
    verb->add_option("--shading", a->draw.shading, "smooth (default) or flat")
        ->type_name("NAME")
        ->transform(CLI::CheckedTransformer(shadings).description(""));
    verb->add_option("--json", a->json, "Report as JSON, to a file or to stdout (-)")->type_name("FILE|-");
    add_view_options(*verb, a->view);
    add_display_options(*verb, a->display);
    add_what_options(*verb, a->what);
    verb->footer("Examples:\n  unseen render bunny.vdt -o bunny.png --wireframe\n"
                 "  unseen render bunny.vdt -o full.pfm --full --size 1024x1024\n"
                 "  unseen render bunny.vdt -o aside.pfm --gaze 1603 512 --json -");
    return {verb, [a] { return run(*a); }};
}

} // namespace unseen::app
