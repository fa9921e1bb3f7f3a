// A program with the installed package.
#include <cstdio>
#include <skin_calib_json.hpp>

int main(int, char** arguments) {
    skin_calib::Skin skin;
    const skin_calib::Status status = skin_calib::load(arguments[1], "", {}, skin);
    std::printf("%s\n", status.ok ? "the package works" : status.message.c_str());
    return !status.ok;
}
