#include <iostream>
#include <tomofield/error.h>
#include <tomofield/version.h>
int main() try {
  std::cout << "tomofield " << tomofield::library_version() << '\n';
  throw tomofield::Error("an error as the library throws it");
} catch (const tomofield::Error& error) {
  std::cout << "caught " << error.what() << '\n';
}
