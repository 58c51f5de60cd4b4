// Runs the command `unseen` as a user does, in a folder of the test's own.
#pragma once

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <nlohmann/json.hpp>
#include <unseen/perception/image.h>

#include "temp_folder.h"
#include "testing.h"

extern char** environ;

namespace unseen::app::testing {

namespace fs = std::filesystem;
using Json = nlohmann::json;

using Words = std::vector<std::string>;

inline Words joined(Words words, const Words& more) {
    words.insert(words.end(), more.begin(), more.end());
    return words;
}

inline std::string read_text(const fs::path& file) {
    std::ifstream stream(file, std::ios::binary);
    std::stringstream text;
    text << stream.rdbuf();
    return text.str();
}

inline void write_text(const fs::path& file, const std::string& text) { std::ofstream(file, std::ios::binary) << text; }

// Waits for a process; its exit status, or minus the signal that ended it.
inline int wait_for(pid_t process) {
    int status = 0;
    if (waitpid(process, &status, 0) != process) return -1000;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

struct Outcome {
    int status = 0;
    std::string out, err;

    Json json() const { return Json::parse(out, nullptr, false); }
    friend std::ostream& operator<<(std::ostream& stream, const Outcome& outcome) {
        return stream << "status " << outcome.status << "\n" << outcome.out << outcome.err;
    }
};

// Of an outcome: the status, and what is said on stderr.
template <class Matcher>
auto fails(int status, Matcher error) {
    return AllOf(::testing::Field("status", &Outcome::status, status), ::testing::Field("err", &Outcome::err, error));
}

// A fixture with an empty folder, where the command runs.
class CommandTest : public ::testing::Test {
protected:
    void SetUp() override {
        std::string name = (fs::temp_directory_path() / "unseen-test-XXXXXX").string();
        ASSERT_NE(mkdtemp(name.data()), nullptr);
        folder_ = name;
        // Nothing of a test is the user's. Its cases share what is built and measured of meshes that they have in common.
        static const support::TempFolder kept_trees;
        ::setenv("UNSEEN_CACHE", kept_trees.path().c_str(), 1);
    }
    void TearDown() override {
        std::error_code ignored;
        fs::remove_all(folder_, ignored);
    }

    const fs::path& folder() const { return folder_; }
    fs::path path(const std::string& name) const { return folder_ / name; }

    pid_t start(const Words& arguments, const fs::path& out, const fs::path& err, const std::string& input = {}) const {
        return start_program(joined({UNSEEN_COMMAND}, arguments), out, err, input);
    }

    // The first word is the program's path.
    pid_t start_program(Words words, const fs::path& out, const fs::path& err, const std::string& input = {}) const {
        write_text(out.string() + ".in", input);
        std::vector<char*> argv;
        for (std::string& word : words) argv.push_back(word.data());
        argv.push_back(nullptr);
        posix_spawn_file_actions_t actions;
        posix_spawn_file_actions_init(&actions);
        posix_spawn_file_actions_addopen(&actions, 0, (out.string() + ".in").c_str(), O_RDONLY, 0);
        posix_spawn_file_actions_addopen(&actions, 1, out.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
        posix_spawn_file_actions_addopen(&actions, 2, err.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
        posix_spawn_file_actions_addchdir_np(&actions, folder_.c_str());
        // Shells in the background hand on signals that are ignored.
        sigset_t ending;
        sigemptyset(&ending);
        for (const int signal : {SIGINT, SIGTERM, SIGHUP}) sigaddset(&ending, signal);
        posix_spawnattr_t attributes;
        posix_spawnattr_init(&attributes);
        posix_spawnattr_setsigdefault(&attributes, &ending);
        posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGDEF);
        pid_t process = -1;
        const int failed = posix_spawn(&process, argv[0], &actions, &attributes, argv.data(), environ);
        posix_spawnattr_destroy(&attributes);
        posix_spawn_file_actions_destroy(&actions);
        return failed ? -1 : process;
    }

    Outcome run(const Words& arguments, const std::string& input = {}) const {
        return run_program(joined({UNSEEN_COMMAND}, arguments), input);
    }
    // Ends the test where the command fails.
    Outcome succeed(const Words& arguments, const std::string& input = {}) const {
        Outcome outcome = run(arguments, input);
        if (outcome.status != 0)
            throw std::runtime_error(::testing::PrintToString(arguments) + ": " + ::testing::PrintToString(outcome));
        return outcome;
    }
    Outcome run_shell(const std::string& command) const { return run_program({"/bin/sh", "-c", command}); }

    Outcome run_program(Words words, const std::string& input = {}) const {
        // Beside the folder, so that its content is the command's alone.
        const fs::path out = folder_.string() + ".out", err = folder_.string() + ".err";
        const std::string program = words.front();
        const pid_t process = start_program(std::move(words), out, err, input);
        EXPECT_GT(process, 0) << program;
        Outcome outcome;
        outcome.status = wait_for(process);
        outcome.out = read_text(out);
        outcome.err = read_text(err);
        for (const fs::path& file : {out, err, fs::path(out.string() + ".in")}) fs::remove(file);
        return outcome;
    }

    std::set<std::string> files() const {
        std::set<std::string> names;
        for (const auto& entry : fs::directory_iterator(folder_)) names.insert(entry.path().filename().string());
        return names;
    }

    // A bumpy closed ball of 2 * rings * sectors - 2 * sectors triangles, about a unit large.
    fs::path write_ball(const std::string& name, int rings = 24, int sectors = 32) const {
        std::ostringstream obj;
        const double pi = std::numbers::pi;
        obj << "v 0 1 0\nv 0 -1 0\n";
        for (int r = 1; r < rings; ++r) {
            for (int s = 0; s < sectors; ++s) {
                const double polar = pi * r / rings, turn = 2 * pi * s / sectors;
                const double radius = 1 + 0.05 * std::sin(5 * turn) * std::sin(4 * polar);
                obj << "v " << radius * std::sin(polar) * std::sin(turn) << ' ' << radius * std::cos(polar) << ' '
                    << radius * std::sin(polar) * std::cos(turn) << '\n';
            }
        }
        const auto vertex = [&](int r, int s) { return 3 + (r - 1) * sectors + s % sectors; };
        for (int s = 0; s < sectors; ++s) {
            obj << "f 1 " << vertex(1, s) << ' ' << vertex(1, s + 1) << '\n';
            obj << "f 2 " << vertex(rings - 1, s + 1) << ' ' << vertex(rings - 1, s) << '\n';
            for (int r = 1; r + 1 < rings; ++r) {
                obj << "f " << vertex(r, s) << ' ' << vertex(r + 1, s) << ' ' << vertex(r + 1, s + 1) << '\n';
                obj << "f " << vertex(r, s) << ' ' << vertex(r + 1, s + 1) << ' ' << vertex(r, s + 1) << '\n';
            }
        }
        write_text(path(name), obj.str());
        return path(name);
    }
    static constexpr int ball_triangles = 2 * 32 * 23;
    static constexpr int ball_vertices = 2 + 32 * 23;

    // Whether the judge sees no pixel change between two models, both whole, drawn with these options; yes where nothing
    // can be drawn. Leaves a.pfm and b.pfm.
    ::testing::AssertionResult look_the_same(const std::string& a, const std::string& b, const Words& view) const {
        for (const auto& [model, picture] : {std::pair(a, "a.pfm"), std::pair(b, "b.pfm")}) {
            const Outcome drawn = run(joined({"render", model, "-o", picture, "--full"}, view));
            if (drawn.err.find("No OpenGL") != std::string::npos) return ::testing::AssertionSuccess();
            if (drawn.status != 0) return ::testing::AssertionFailure() << drawn.err;
        }
        const auto picture = perception::read_image(path("a.pfm"));
        const auto [least, most] = std::minmax_element(picture->image.values.begin(), picture->image.values.end());
        if (!(*most > 2 * *least)) return ::testing::AssertionFailure() << "there is nothing to be seen";
        const Outcome compared = run({"compare", "a.pfm", "b.pfm", "--json", "-"});
        if (compared.json()["visible_pixels"] == 0) return ::testing::AssertionSuccess();
        return ::testing::AssertionFailure() << a << " and " << b << " differ: " << compared.out << compared.err;
    }

    // The ball, and its tree, as ball.vdt.
    void build_ball() const {
        write_ball("ball.obj");
        static std::string tree; // made once
        if (tree.empty()) {
            succeed({"build", "ball.obj", "-o", "ball.vdt", "--threads", "1"});
            tree = read_text(path("ball.vdt"));
        }
        write_text(path("ball.vdt"), tree);
    }

    // Why nothing can be drawn; nothing where it can.
    const std::string& no_opengl() const {
        static std::optional<std::string> reason; // found out once
        if (!reason) {
            write_ball("probe.obj", 4, 4);
            const Outcome probe = run({"render", "probe.obj", "-o", "probe.png", "--size", "8x8", "--samples", "1"});
            EXPECT_TRUE(probe.status == 0 || probe.err.find("No OpenGL") != std::string::npos) << probe.err;
            reason = probe.status == 0 ? "" : probe.err;
            for (const char* file : {"probe.obj", "probe.png"}) fs::remove(path(file));
        }
        return *reason;
    }

private:
    fs::path folder_;
};

// Whether a sentence speaks of the session library's fields instead of the command's options.
inline bool names_fields(const std::string& text) {
    const Words fields = {"request.",    "observer.csf", "load.texture",     "load.without",
                          "load.prelit", "scene.lights", "scene.background", "::"};
    return std::any_of(fields.begin(), fields.end(),
                       [&](const std::string& field) { return text.find(field) != std::string::npos; });
}

// One sentence for people, on stderr.
MATCHER(IsAnErrorForPeople, "one sentence that begins with 'unseen: ' and names options") {
    return arg.rfind("unseen: ", 0) == 0 && std::count(arg.begin(), arg.end(), '\n') == 1 && !names_fields(arg);
}

inline std::set<std::string> keys(const Json& object) {
    std::set<std::string> names;
    for (const auto& item : object.items()) names.insert(item.key());
    return names;
}

// The keys that simplify and render report, with their types.
inline void expect_cut_report(const Json& report) {
    ASSERT_TRUE(report.is_object()) << report;
    std::set<std::string> names = keys(report);
    names.erase("shadows"); // of pictures with lights that cast some
    names.erase("passes");  // of pictures that go by what they show
    EXPECT_THAT(names, ::testing::UnorderedElementsAre("source_triangles", "triangles", "dropped", "node_tests",
                                                       "adapt_ms", "extract_ms", "draw_ms", "imperceptible_from_m",
                                                       "max_fold_cost", "effects", "as", "tree"));
    for (const char* key : {"source_triangles", "triangles", "dropped", "node_tests"})
        EXPECT_TRUE(report[key].is_number_unsigned()) << key << ": " << report[key];
    for (const char* key : {"adapt_ms", "extract_ms"})
        EXPECT_TRUE(report[key].is_number_float() && report[key] >= 0) << key << ": " << report[key];
    for (const char* key : {"draw_ms", "imperceptible_from_m", "max_fold_cost"})
        EXPECT_TRUE(report[key].is_number() || report[key].is_null()) << key << ": " << report[key];
    ASSERT_TRUE(report["effects"].is_array());
    for (const Json& effect : report["effects"]) {
        EXPECT_THAT(keys(effect), ::testing::UnorderedElementsAre("name", "on", "why"));
        EXPECT_TRUE(effect["name"].is_string() && effect["on"].is_boolean() && effect["why"].is_string()) << effect;
        EXPECT_FALSE(effect["why"].get<std::string>().empty()) << effect;
        EXPECT_FALSE(names_fields(effect["why"].get<std::string>())) << effect;
    }
}

inline Json effect_named(const Json& report, const std::string& name) {
    for (const Json& effect : report["effects"])
        if (effect["name"] == name) return effect;
    return {};
}

// Of verbs that draw, with a tree of a ball; passed over where there is no OpenGL.
class DrawingCommandTest : public CommandTest {
protected:
    void SetUp() override {
        CommandTest::SetUp();
        build_ball();
        if (!no_opengl().empty()) GTEST_SKIP() << no_opengl();
    }
};

} // namespace unseen::app::testing
