// A window of the command, driven from another X client by synthetic events.
#pragma once

#include "run_command.h" // with GoogleTest, which must come before X11's macros

#include <chrono>
#include <string>
#include <thread>

#include <X11/Xlib.h>
#include <X11/Xutil.h>
#include <X11/keysym.h>

namespace unseen::app::testing {

inline constexpr std::chrono::seconds patience{60}; // software rendering on a busy machine
inline constexpr std::chrono::milliseconds poll_pause{20};

// The first window whose title begins or ends with "Unseen".
class RemoteWindow {
public:
    explicit RemoteWindow(Display* display) : display_(display) {}

    // Waits for it, as long as a process runs.
    bool find(pid_t process) {
        const auto has_ended = [&] {
            siginfo_t info{};
            return waitid(P_PID, static_cast<id_t>(process), &info, WEXITED | WNOHANG | WNOWAIT) == 0 && info.si_pid;
        };
        const auto end = std::chrono::steady_clock::now() + patience;
        while (std::chrono::steady_clock::now() < end && !has_ended()) {
            window_ = search(DefaultRootWindow(display_));
            if (window_) return true;
            std::this_thread::sleep_for(poll_pause);
        }
        return false;
    }

    std::string title() const { return title_of(window_); }

    // Waits until the title contains a text; the last title if it never does.
    std::string title_with(const std::string& text) const {
        const auto end = std::chrono::steady_clock::now() + patience;
        std::string last;
        while (std::chrono::steady_clock::now() < end) {
            last = title();
            if (last.find(text) != std::string::npos) return last;
            std::this_thread::sleep_for(poll_pause);
        }
        return last;
    }

    void press(KeySym key, unsigned modifiers = 0) {
        XEvent event{};
        event.xkey.keycode = XKeysymToKeycode(display_, key);
        event.xkey.state = modifiers;
        for (const int type : {KeyPress, KeyRelease}) {
            fill(event.xkey, type);
            send(event, type == KeyPress ? KeyPressMask : KeyReleaseMask);
        }
    }

    void move_to(int x, int y, unsigned held = 0) {
        XEvent event{};
        fill(event.xmotion, MotionNotify);
        event.xmotion.x = x;
        event.xmotion.y = y;
        event.xmotion.state = held;
        send(event, PointerMotionMask);
    }

    void button(unsigned number, bool is_down, int x, int y, unsigned modifiers = 0) {
        XEvent event{};
        event.xbutton.state = modifiers;
        fill(event.xbutton, is_down ? ButtonPress : ButtonRelease);
        event.xbutton.button = number;
        event.xbutton.x = x;
        event.xbutton.y = y;
        send(event, is_down ? ButtonPressMask : ButtonReleaseMask);
    }

private:
    std::string title_of(Window window) const {
        char* text = nullptr;
        std::string title;
        if (XFetchName(display_, window, &text) && text) title = text;
        if (text) XFree(text);
        return title;
    }

    Window search(Window window) const {
        if (const std::string title = title_of(window); title.starts_with("Unseen") || title.ends_with("Unseen"))
            return window;
        Window root = 0, parent = 0, found = 0;
        Window* children = nullptr;
        unsigned count = 0;
        if (!XQueryTree(display_, window, &root, &parent, &children, &count)) return 0;
        for (unsigned i = 0; i < count && !found; ++i) found = search(children[i]);
        if (children) XFree(children);
        return found;
    }

    template <class Event>
    void fill(Event& event, int type) {
        event.type = type;
        event.display = display_;
        event.window = window_;
        event.root = DefaultRootWindow(display_);
        event.same_screen = True;
        event.time = ++time_;
    }

    void send(XEvent& event, long mask) {
        XSendEvent(display_, window_, True, mask, &event);
        XFlush(display_);
    }

    Display* display_;
    Window window_ = 0;
    Time time_ = 1;
};

} // namespace unseen::app::testing
