// unseen cache: the trees that are kept for the next time.
#include <chrono>
#include <ctime>
#include <memory>

#include <unseen/session/load.h>

#include "options.h"
#include "report.h"
#include "terminal.h"
#include "verbs.h"

namespace unseen::app {
namespace {

struct CacheArguments {
    std::string limit, json;
    bool clears = false;
};

std::string time_text(std::chrono::system_clock::time_point time, const char* format, bool is_utc) {
    const std::time_t seconds = std::chrono::system_clock::to_time_t(time);
    std::tm parts{};
    if (!(is_utc ? ::gmtime_r(&seconds, &parts) : ::localtime_r(&seconds, &parts))) return "unknown";
    char text[32];
    return {text, std::strftime(text, sizeof text, format, &parts)};
}

Json to_json(const session::CachedTree& tree) {
    return {{"source", tree.source},
            {"file", tree.file.string()},
            {"bytes", tree.bytes},
            {"last_use", time_text(tree.last_use, "%Y-%m-%dT%H:%M:%SZ", true)}};
}

void print_trees(const session::TreeCache& cache, const std::vector<session::CachedTree>& trees, std::size_t removed) {
    if (removed > 0) print_line("removed " + grouped(removed) + (removed == 1 ? " tree" : " trees"));
    std::uint64_t bytes = 0;
    std::vector<std::vector<std::string>> rows;
    for (const session::CachedTree& tree : trees) {
        bytes += tree.bytes;
        rows.push_back({tree.source, file_size(tree.bytes), time_text(tree.last_use, "%Y-%m-%d %H:%M", false)});
    }
    if (!rows.empty()) rows.insert(rows.begin(), {"tree of", "size", "last use"});
    print_table(std::move(rows));
    print_line(grouped(trees.size()) + (trees.size() == 1 ? " tree, " : " trees, ") + file_size(bytes) + " of " +
               file_size(cache.most_bytes()) + ", in " + cache.folder().string());
}

Result<int> run(const CacheArguments& a) {
    auto report = JsonReport::open(a.json);
    if (!report) return report.error();
    const session::TreeCache cache;
    if (const auto sound = cache.check(); !sound) return sound.error();
    std::size_t removed = 0;
    if (a.clears) removed = cache.shrink(0).size();
    else if (!a.limit.empty()) removed = cache.shrink(*session::parse_size(a.limit)).size();
    const auto trees = cache.trees();
    Json json = {{"folder", cache.is_on() ? Json(cache.folder().string()) : Json(nullptr)},
                 {"limit_bytes", cache.most_bytes()},
                 {"removed", removed},
                 {"trees", Json::array()}};
    for (const session::CachedTree& tree : trees) json["trees"].push_back(to_json(tree));
    if (auto ok = report->write(json); !ok) return ok.error();
    if (report->is_on_stdout()) return exit_done;
    if (cache.is_on()) print_trees(cache, trees, removed);
    else print_line("there is no cache: $UNSEEN_CACHE is off, or no folder is known");
    return exit_done;
}

} // namespace

Command cache_command(CLI::App& app) {
    auto a = std::make_shared<CacheArguments>();
    CLI::App* verb = app.add_subcommand("cache", "List the trees of meshes that are kept for the next time");
    CLI::Option* clear = verb->add_flag("--clear", a->clears, "Remove all of them");
    verb->add_option("--limit", a->limit, "Remove those not used for longest, until the rest takes SIZE at most")
        ->type_name("SIZE")
        ->check([](const std::string& text) {
            const auto size = session::parse_size(text);
            return size ? "" : size.error().message;
        })
        ->excludes(clear);
    add_json_option(*verb, a->json);
    verb->footer(
        "A mesh that is given in place of a tree is built and measured once. Its tree is kept in\n"
        "$UNSEEN_CACHE (off: nowhere), else $XDG_CACHE_HOME/unseen, else ~/.cache/unseen, and taken from there\n"
        "as long as the mesh, the files it refers to and the options are the same. At most $UNSEEN_CACHE_SIZE\n"
        "is kept (default: 4G); what was not used for longest goes first. Kept, too, is what is measured of a\n"
        "tree that is a file, and of any under lights (MESH+lights).\n\n"
        "Examples:\n  unseen cache\n  unseen cache --limit 500M\n  unseen cache --clear");
    return {verb, [a] { return run(*a); }};
}

} // namespace unseen::app
