// Tests of a command that opens a window: with a screen, a client and a folder of their own.
#pragma once

#include "remote_window.h"
#include "run_command.h"
#include "virtual_display.h"

#include <csignal>
#include <memory>
#include <string>
#include <vector>

namespace unseen::app::testing {

class WindowTest : public CommandTest {
protected:
    // Skips, with the reason, where there is no display.
    void SetUp() override {
        CommandTest::SetUp();
        screen_ = std::make_unique<render::testing::VirtualDisplay>();
        if (!screen_->reason().empty()) GTEST_SKIP() << "no display: " << screen_->reason();
        display_ = XOpenDisplay(nullptr);
        if (!display_) GTEST_SKIP() << "the display does not answer";
        XSetErrorHandler(go_on_without_the_window);
    }
    void TearDown() override {
        if (process_ > 0) {
            kill(process_, SIGKILL);
            wait_for(process_);
        }
        if (display_) XCloseDisplay(display_);
        if (screen_ && screen_->reason().empty()) unsetenv("DISPLAY"); // the next test has a screen of its own
        screen_.reset();
        CommandTest::TearDown();
    }

    // The command `words` with `more`. False where no window with OpenGL can be opened; errors() has the reason.
    bool open(std::vector<std::string> words, const std::vector<std::string>& more) {
        words.insert(words.end(), more.begin(), more.end());
        words.insert(words.begin(), UNSEEN_COMMAND);
        return open_program(words);
    }
    // The same of a program that runs the command.
    bool open_program(const std::vector<std::string>& words) {
        process_ = start_program(words, path("out.txt"), path("err.txt"));
        window_ = std::make_unique<RemoteWindow>(display_);
        return process_ > 0 && window_->find(process_);
    }
    int ended() {
        const int status = wait_for(process_);
        process_ = -1;
        return status;
    }
    RemoteWindow& window() { return *window_; }
    std::string errors() const { return read_text(path("err.txt")); }

private:
    // A command that ends on a key's press has no window left for its release. Xlib's own handler would end the test's
    // process.
    static int go_on_without_the_window(Display*, XErrorEvent* error) {
        if (error->error_code != BadWindow)
            ADD_FAILURE() << "X error " << int(error->error_code) << " of request " << int(error->request_code);
        return 0;
    }

    std::unique_ptr<render::testing::VirtualDisplay> screen_;
    Display* display_ = nullptr;
    std::unique_ptr<RemoteWindow> window_;
    pid_t process_ = -1;
};

} // namespace unseen::app::testing
