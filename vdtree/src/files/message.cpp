#include <unseen/vdtree/result.h>

namespace unseen {

Message Message::of(std::string_view text, std::initializer_list<std::string_view> values) {
    Message message;
    const auto* value = values.begin();
    for (std::size_t at = 0; at < text.size();) {
        const std::size_t open = text.find('{', at), close = text.find('}', open);
        message += text.substr(at, open - at);
        if (close == std::string_view::npos) break;
        const std::string_view name = text.substr(open + 1, close - open - 1);
        if (name.empty()) {
            assert(value != values.end() && "a value for each {}");
            message += *value++;
        } else {
            message.names_.push_back({message.size(), name.size()});
            message += name;
        }
        at = close + 1;
    }
    return message;
}

Message Message::joined(const Message& a, const Message& b) {
    Message both = a;
    for (const Name& name : b.names_) both.names_.push_back({a.size() + name.begin, name.size});
    both += b;
    return both;
}

std::string_view Error::field() const {
    const auto names = message.names();
    return names.empty() ? std::string_view() : std::string_view(message).substr(names[0].begin, names[0].size);
}

} // namespace unseen
