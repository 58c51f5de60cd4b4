// unseen study: whether people, or a simulated one, tell a simplification from its original.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>

#include <unseen/calibration/internal/picture_observer.h>
#include <unseen/calibration/study.h>
#include <unseen/session_gpu/study_pictures.h>
#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/number_text.h>

#include "options.h"
#include "output_files.h"
#include "progress_bar.h"
#include "report.h"
#include "session_options.h"
#include "study_window.h"
#include "terminal.h"
#include "verbs.h"

namespace unseen::app {
namespace {

using calibration::Study;
using calibration::StudyTask;
namespace fs = std::filesystem;

constexpr const char* study_file = "study.json";

struct StudyArguments {
    ViewOptions& view;
    DisplayOptions& display;
    // make
    std::vector<std::string> models = {}, conditions = {}, training = {};
    std::string folder = {};
    std::optional<StudyTask> task = {};
    bool levels = false;
    std::optional<double> views = {}, samples = {}, repeats = {}, seed = {};
    std::vector<double> distances = {};
    session::LevelControlOptions control = {};
    // run
    std::string subject = "unnamed", simulate = {}, answers = {};
    StudyWindowOptions window = {};
    // analyse
    std::vector<std::string> files = {};
    std::string json = {};
    bool markdown = false;
    enum class Part { make, run, analyse } part = Part::make;
};

// ---- make

// "imperceptible", "threshold:4", "pixels:2", "triangles:5000" or "triangles:5%".
Result<session::StudyCondition> condition_named(const std::string& text, std::uint64_t all_triangles) {
    session::StudyCondition condition{.name = text, .request = {}};
    const std::size_t colon = text.find(':');
    const std::string kind = text.substr(0, colon), value = colon == text.npos ? "" : text.substr(colon + 1);
    if (kind == "imperceptible" && colon == text.npos) return condition;
    const auto number = finite_from(value);
    const bool is_positive = number && *number > 0;
    if (kind == "threshold" && is_positive) {
        condition.request.goal = Goal::up_to(*number);
        return condition;
    }
    if (kind == "pixels" && is_positive) {
        condition.request.goal = Goal::pixels(*number);
        return condition;
    }
    if (const auto count = TriangleCount::of(value); kind == "triangles" && count) {
        condition.request.goal = Goal::budget(count->of(all_triangles));
        return condition;
    }
    return invalid_argument(
        "'" + text +
        "' is no condition: give imperceptible, threshold:X, pixels:E, triangles:N or triangles:P%, "
        "with a number above 0.");
}

Result<std::vector<session::StudyCondition>> conditions_of(const StudyArguments& a, std::uint64_t all_triangles) {
    std::vector<session::StudyCondition> all;
    for (const bool is_training : {true, false})
        for (const std::string& text : is_training ? a.training : a.conditions) {
            auto condition = condition_named(text, all_triangles);
            if (!condition) return condition.error();
            condition->is_training = is_training;
            all.push_back(std::move(*condition));
        }
    return all;
}

session::StudyPicturesOptions pictures_of(const StudyArguments& a, std::size_t model, const session::Session& session) {
    session::StudyPicturesOptions options;
    options.folder = a.folder;
    options.prefix =
        fs::path(a.models[model]).stem().string() + "-" + (a.models.size() > 1 ? std::to_string(model + 1) + "-" : "");
    const bool is_scene = session.scene().objects.size() > 1 || !session.scene().backdrop.empty();
    options.views = static_cast<int>(a.views.value_or(is_scene ? 1 : 5));
    // All around a model; a scene is looked at from about where its camera is.
    options.degrees = is_scene ? 3 : 360.0 / options.views;
    options.samples = static_cast<int>(a.samples.value_or(64));
    if (!a.distances.empty()) options.distances = a.distances;
    return options;
}

Result<void> add_pairs(StudyArguments& a, std::size_t model, const render::Context& context, Study& study) {
    auto session = open_session(a.models[model], a.view, a.display);
    if (!session) return session.error();
    study.pixels_per_degree = perception::pixels_per_degree(session->observer().display).value();
    session::StudyPicturesOptions options = pictures_of(a, model, *session);
    options.pairs_original = study.task == StudyTask::differ;
    ProgressBar bar("drawing " + a.models[model]);
    options.progress = std::ref(bar);
    const vdtree::View view = make_view(*session, a.view);
    Result<std::vector<calibration::StudyPair>> pairs = std::vector<calibration::StudyPair>();
    if (a.levels) {
        pairs = session::draw_level_pairs(*session, context, view, a.control, options);
    } else {
        const auto conditions = conditions_of(a, session->triangle_count());
        if (!conditions) return conditions.error();
        pairs = session::draw_study_pairs(*session, context, view, *conditions, options);
    }
    if (!pairs) return pairs.error();
    std::ranges::move(*pairs, std::back_inserter(study.pairs));
    return {};
}

Result<int> make_study(StudyArguments& a) {
    const fs::path folder = a.folder;
    std::vector<std::string> inputs;
    for (const std::string& model : a.models)
        for (const std::string& input : inputs_of(model, a.view, a.display)) inputs.push_back(input);
    if (const auto ready = check_outputs(inputs, {(folder / study_file).string()}); !ready) return ready.error();
    auto context = render::Context::headless();
    if (!context) return context.error();
    Study study;
    study.task = a.task.value_or(a.levels ? StudyTask::differ : StudyTask::which);
    if (a.repeats) study.repeats = static_cast<int>(*a.repeats);
    if (a.seed) study.seed = static_cast<std::uint64_t>(*a.seed);
    for (std::size_t i = 0; i < a.models.size(); ++i)
        if (const auto added = add_pairs(a, i, *context, study); !added) return added.error();
    if (const auto written = calibration::write_study(folder / study_file, study); !written) return written.error();
    print_line(std::to_string(study.pairs.size()) + " pairs, " +
               std::to_string(calibration::trials_of(study, "").size()) + " trials a subject");
    print_written({(folder / study_file).string()});
    return exit_done;
}

// ---- run

// Pictures are judged once, however often they are shown.
class SimulatedSubject {
public:
    SimulatedSubject(calibration::PictureObserver observer, const perception::Display& display, const Study& study)
        : observer_(observer), display_(display), study_(study), visibility_(study.pairs.size()) {}

    Result<calibration::StudyAnswer> answer(const calibration::StudyTrial& trial) {
        std::optional<double>& visibility = visibility_[trial.pair];
        if (!visibility) {
            const auto looked = look(study_.pairs[trial.pair]);
            if (!looked) return looked.error();
            visibility = *looked;
        }
        return calibration::StudyAnswer{trial, observer_.choose(study_.task, trial, *visibility), 0};
    }

private:
    Result<double> look(const calibration::StudyPair& pair) const {
        const auto original = perception::read_image(pair.original);
        if (!original) return original.error();
        const auto other = perception::read_image(pair.other);
        if (!other) return other.error();
        auto seen = observer_.visibility(perception::to_luminance(*original, display_),
                                         perception::to_luminance(*other, display_), display_);
        if (!seen)
            return Error{seen.error().code,
                         pair.original.string() + " and " + pair.other.string() + ": " + seen.error().message};
        return seen;
    }

    calibration::PictureObserver observer_;
    const perception::Display& display_;
    const Study& study_;
    std::vector<std::optional<double>> visibility_;
};

void warn_of_another_display(const Study& study, const perception::Display& display) {
    constexpr double alike = 0.02;
    const double ppd = perception::pixels_per_degree(display).value();
    if (!(std::abs(ppd / study.pixels_per_degree - 1) <= alike))
        print_warning("the pictures were made for " + rounded(study.pixels_per_degree, 3) +
                      " pixels a degree, and this display has " + rounded(ppd, 3) +
                      ": change the distance (--distance), or make them for it.");
}

using Trials = std::vector<calibration::StudyTrial>;
using Answers = std::vector<calibration::StudyAnswer>;

Result<void> simulate(const StudyArguments& a, const Study& study, const perception::Display& display,
                      const Trials& trials, Answers& answers) {
    const auto person = perception::person(a.simulate);
    if (!person) return person.error();
    const calibration::PictureObserver observer{.person = *person, .seed = study.seed};
    SimulatedSubject subject(observer, display, study);
    ProgressBar bar("answering");
    for (std::size_t i = answers.size(); i < trials.size(); ++i) {
        bar(static_cast<double>(i) / static_cast<double>(trials.size()), "trials");
        auto answer = subject.answer(trials[i]);
        if (!answer) return answer.error();
        answers.push_back(*answer);
    }
    return calibration::write_answers(a.answers, study, a.subject, answers);
}

Result<int> run_study(StudyArguments& a) {
    const auto display = make_display(a.display);
    if (!display) return display.error();
    const fs::path file = fs::path(a.folder) / study_file;
    const auto study = calibration::read_study(file);
    if (!study) return study.error();
    if (a.answers.empty()) a.answers = (fs::path(a.folder) / ("answers-" + a.subject + ".csv")).string();
    warn_of_another_display(*study, *display);
    const Trials trials = calibration::trials_of(*study, a.subject);
    Answers answers;
    if (fs::exists(a.answers)) {
        auto before = calibration::read_answers(a.answers, *study, a.subject);
        if (!before) return before.error();
        answers = std::move(*before);
    } else if (const auto ready = check_outputs({file.string()}, {a.answers}); !ready) return ready.error();
    if (!a.simulate.empty()) {
        if (const auto done = simulate(a, *study, *display, trials, answers); !done) return done.error();
    } else if (answers.size() < trials.size()) {
        const auto keep = [&](const calibration::StudyAnswer& answer) {
            answers.push_back(answer);
            return calibration::write_answers(a.answers, *study, a.subject, answers);
        };
        if (auto shown = run_study_window(*study, trials, answers.size(), a.window, keep); !shown) return shown.error();
    }
    print_line(std::to_string(answers.size()) + " of " + std::to_string(trials.size()) + " trials are answered" +
               (answers.size() < trials.size() ? "; the same command continues." : "."));
    if (!answers.empty()) print_written({a.answers});
    return exit_done;
}

// ---- analyse

Json to_json(const calibration::Share& share) {
    return {{"count", share.count},
            {"of", share.of},
            {"share", share.value()},
            {"low", share.low()},
            {"high", share.high()}};
}

Json to_json(std::span<const calibration::StepResult> steps) {
    Json json = Json::array();
    for (const calibration::StepResult& result : steps)
        json.push_back(
            {{"level", result.kept}, {"step", calibration::name(result.step)}, {"agreed", to_json(result.agreed)}});
    return json;
}

Json to_json(const calibration::StudyAnalysis& analysis) {
    Json conditions = Json::array();
    for (const calibration::ConditionResult& result : analysis.conditions) {
        conditions.push_back({{"condition", result.condition},
                              {"task", calibration::name(result.task)},
                              {"seen", to_json(result.seen)},
                              {"chance", result.chance},
                              {"agreed", result.agreed ? to_json(*result.agreed) : Json()},
                              {"median_s", result.median_s}});
    }
    return {{"subjects", analysis.subjects},
            {"careless", analysis.careless},
            {"false_alarms", analysis.false_alarms ? to_json(*analysis.false_alarms) : Json()},
            {"agreed", analysis.agreed ? to_json(*analysis.agreed) : Json()},
            {"steps", to_json(std::span<const calibration::StepResult>(analysis.steps))},
            {"steps_of_2007", analysis.steps.empty() ? Json() : to_json(calibration::steps_of_2007())},
            {"conditions", std::move(conditions)}};
}

std::string percent(double share) { return rounded(100 * share, 3) + "%"; }
std::string interval(const calibration::Share& share) { return percent(share.low()) + " to " + percent(share.high()); }

// A row a level that was kept, and one of all; a column a step.
void add_steps(std::span<const calibration::StepResult> steps, const std::string& who,
               std::vector<std::vector<std::string>>& rows) {
    constexpr std::array all_steps = {calibration::LevelStep::decrease, calibration::LevelStep::maintain,
                                      calibration::LevelStep::increase};
    const auto add = [&](const std::string& label, std::optional<int> kept) {
        auto& row = rows.emplace_back(std::vector<std::string>{who, label});
        for (const calibration::LevelStep step : all_steps) {
            calibration::Share all;
            for (const calibration::StepResult& result : steps)
                if (result.step == step && result.kept == kept.value_or(result.kept))
                    all.count += result.agreed.count, all.of += result.agreed.of;
            row.push_back(all.of > 0 ? percent(all.value()) + " of " + std::to_string(all.of) : "-");
        }
    };
    std::optional<int> last;
    for (const calibration::StepResult& result : steps)
        if (result.kept != last) add(std::to_string(result.kept), result.kept), last = result.kept;
    add("all", std::nullopt);
}

void print(const calibration::StudyAnalysis& analysis, bool markdown) {
    std::vector<std::vector<std::string>> rows = {
        {"condition", "trials", "seen", "95%", "by chance", "as predicted", "median s"}};
    for (const calibration::ConditionResult& result : analysis.conditions)
        rows.push_back({result.condition, std::to_string(result.seen.of), percent(result.seen.value()),
                        interval(result.seen), rounded(result.chance, 3),
                        result.agreed ? percent(result.agreed->value()) : "-", rounded(result.median_s, 3)});
    markdown ? print_markdown(rows) : print_table(rows);
    if (markdown) print_line("");
    print_line(
        "seen: of `which` right answers, half of them by guessing; of `differ` \"different\". by chance: how likely "
        "this, or more, is for somebody who sees nothing.");
    if (analysis.false_alarms)
        print_line("\"different\" of one picture and itself: " + percent(analysis.false_alarms->value()) + " (" +
                   interval(*analysis.false_alarms) + ")");
    if (analysis.agreed)
        print_line("as predicted: " + percent(analysis.agreed->value()) + " (" + interval(*analysis.agreed) + ") of " +
                   std::to_string(analysis.agreed->of));
    if (!analysis.steps.empty()) {
        std::vector<std::vector<std::string>> steps = {
            {"as decided", "level kept", "decrease", "maintain", "increase"}};
        add_steps(analysis.steps, "these answers", steps);
        add_steps(calibration::steps_of_2007(), "people, 2007", steps);
        print_line("");
        markdown ? print_markdown(steps) : print_table(steps);
    }
    for (const std::string& subject : analysis.careless)
        print_warning("'" + subject + "' was wrong in more than a third of the training.");
}

Result<int> analyse_study(StudyArguments& a) {
    auto report = open_report(a.files, {}, a.json);
    if (!report) return report.error();
    const std::vector<fs::path> files(a.files.begin(), a.files.end());
    const auto analysis = calibration::analyse_answers(files);
    if (!analysis) return analysis.error();
    if (auto ok = report->write(to_json(*analysis)); !ok) return ok.error();
    if (!report->is_on_stdout()) print(*analysis, a.markdown);
    return exit_done;
}

Result<int> run(StudyArguments& a) {
    switch (a.part) {
    case StudyArguments::Part::make: return make_study(a);
    case StudyArguments::Part::run: return run_study(a);
    case StudyArguments::Part::analyse: return analyse_study(a);
    }
    return exit_failed;
}

// ---- options

void add_make(CLI::App& verb, Setup& setup, const std::shared_ptr<StudyArguments>& a) {
    CLI::App* make = verb.add_subcommand("make", "Draw the pictures of a study");
    make->add_option("MODEL", a->models, "Trees, meshes or scenes")
        ->required()
        ->type_name("TREE.vdt|MESH|SCENE.glb ...");
    make->add_option("-o,--output", a->folder, "Where pictures and study.json go")->required()->type_name("FOLDER");
    add_choice<std::optional<StudyTask>, StudyTask>(
        *make, "--task", a->task, {{"which", StudyTask::which}, {"differ", StudyTask::differ}},
        "What is asked: which of the two is not the original, or whether they "
        "differ (default: which; of --levels: differ)");
    make->add_option("--condition", a->conditions,
                     "What subjects compare with the original: imperceptible, threshold:X, pixels:E, triangles:N or "
                     "triangles:P%; may be given again (default: imperceptible)")
        ->type_name("NAME")
        ->allow_extra_args(false);
    make->add_option("--training", a->training, "Likewise, shown first and not counted (default: triangles:2%)")
        ->type_name("NAME")
        ->allow_extra_args(false);
    CLI::Option* levels = make->add_flag("--levels", a->levels,
                                         "For scenes with one object: the discrete levels around the one that 'unseen "
                                         "levels' keeps, to see whether people agree");
    CLI::Option* maps = add_choice<session::MapRecipe, session::MapRecipe>(
        *make, "--maps", a->control.maps,
        {{"modern", session::MapRecipe::modern}, {"rpg99", session::MapRecipe::rpg99}},
        "With --levels: thresholds of the modern judge (default), or as in the paper of 2007");
    maps->needs(levels);
    const auto count = [&](const char* name, std::optional<double>& value, double most, const char* text) {
        add_value(*make, name, value, whole(1, most), "N", text);
    };
    count("--views", a->views, 360, "Views around each model (default: 5; of a scene 1)");
    add_value(*make, "--distances", a->distances, positive(), "X ...",
              "Distances of the eye, as multiples of the view's; all views from each (default: 1)");
    count("--samples", a->samples, 256, "Samples a pixel (default: 64)");
    count("--repeats", a->repeats, 1000, "How often each pair is shown (default: 2)");
    add_value(*make, "--seed", a->seed, whole(0, 9007199254740992.0), "N",
              "For orders and sides (default: 1)"); // 2^53, to which doubles count
    setup.act_in(*make, Setup::view | Setup::model | Setup::scenes);
    make->callback([a, levels] {
        a->part = StudyArguments::Part::make;
        if (*levels && (!a->conditions.empty() || !a->training.empty()))
            refuse("--levels and --condition or --training exclude each other.");
        if (*levels && a->task == StudyTask::which) refuse("--levels goes with --task differ.");
        if (a->conditions.empty()) a->conditions = {"imperceptible"};
        if (a->training.empty()) a->training = {"triangles:2%"};
    });
    make->footer("Examples:\n  unseen study make horse.ply bunny.vdt -o study --views 10 --size 512x512\n"
                 "  unseen study make museum.glb -o levels --levels --maps rpg99 --size 512x512 --repeats 8");
}

void add_run(CLI::App& verb, Setup& setup, const std::shared_ptr<StudyArguments>& a) {
    CLI::App* part = verb.add_subcommand("run", "Show a study to somebody, or let a simulated observer answer");
    part->add_option("FOLDER", a->folder, "The folder of 'unseen study make'")->required();
    part->add_option("--subject", a->subject, "Who answers: orders and sides follow from it (default: unnamed)")
        ->type_name("NAME")
        ->check([](const std::string& name) {
            const bool is_file_name = !name.empty() && name.size() <= 100 && name.find_first_of("/\\\n\r") == name.npos;
            return is_file_name ? std::string() : "a subject's name goes into a file's: 1 to 100 characters, no slash.";
        });
    part->add_option("--answers", a->answers,
                     "What was answered, and goes on from there (default: answers-NAME.csv in the folder)")
        ->type_name("FILE.csv");
    CLI::Option* simulate =
        part->add_option("--simulate", a->simulate,
                         "Nobody looks: an observer answers who sees by Barten's model, with noise, "
                         "and is right in three of four at the threshold: median, default or strict")
            ->type_name("PERSON");
    part->add_flag("--full-screen", a->window.full_screen, "On the primary monitor")->excludes(simulate);
    add_value(*part, "--seconds", a->window.seconds, positive(), "T",
              "Show each pair for so long (default: until it is answered)")
        ->excludes(simulate);
    add_value(*part, "--screenshot", a->window.screenshot, ending_in({".png"}), "OUT.png",
              "Keep the last pair shown as a picture")
        ->excludes(simulate);
    setup.act_in(*part, Setup::display);
    part->callback([a] { a->part = StudyArguments::Part::run; });
    part->footer(std::string(study_window_help) +
                 "\nExamples:\n  unseen study run study --subject ann --display lab.json --full-screen\n"
                 "  unseen study run study --subject nobody --simulate median");
}

void add_analyse(CLI::App& verb, const std::shared_ptr<StudyArguments>& a) {
    CLI::App* part = verb.add_subcommand("analyse", "What the answers of all subjects come to");
    part->add_option("ANSWERS", a->files, "Files of 'unseen study run'")->required()->type_name("ANSWERS.csv ...");
    add_json_option(*part, a->json);
    part->add_flag("--markdown", a->markdown, "The table in Markdown");
    part->callback([a] { a->part = StudyArguments::Part::analyse; });
    part->footer("Examples:\n  unseen study analyse study/answers-*.csv\n"
                 "  unseen study analyse levels/answers-*.csv --json levels.json");
}

} // namespace

Command study_command(CLI::App& app, Setup& setup) {
    auto a = std::make_shared<StudyArguments>(StudyArguments{setup.view_options(), setup.display_options()});
    CLI::App* verb =
        app.add_subcommand("study", "Whether people, or a simulated one, tell a simplification from its original");
    verb->require_subcommand(1);
    add_make(*verb, setup, a);
    add_run(*verb, setup, a);
    add_analyse(*verb, a);
    verb->footer("Examples:\n  unseen study make horse.ply -o study --views 10 --size 512x512\n"
                 "  unseen study run study --subject ann\n"
                 "  unseen study analyse study/answers-*.csv\n\n'unseen study PART --help' explains a part.");
    return {verb, [a] { return run(*a); }};
}

} // namespace unseen::app
