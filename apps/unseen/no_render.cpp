// The verbs that draw, in a build without OpenGL: they say so.
#include "command.h"

namespace unseen::app {
namespace {

Command absent(CLI::App& app, const std::string& name) {
    CLI::App* verb = app.add_subcommand(name, "Not in this build: it was made without OpenGL");
    verb->allow_extras();
    return {verb, [name]() -> Result<int> {
                return Error{ErrorCode::unsupported, "This build cannot '" + name +
                                                         "', for it was made without OpenGL; "
                                                         "configure it with -DUNSEEN_BUILD_RENDER=ON."};
            }};
}

} // namespace

Command render_command(CLI::App& app) { return absent(app, "render"); }
Command sheet_command(CLI::App& app) { return absent(app, "sheet"); }
Command view_command(CLI::App& app) { return absent(app, "view"); }

} // namespace unseen::app
