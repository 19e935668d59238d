// The source of targets that only provide precompiled headers for others.
int main() {}
